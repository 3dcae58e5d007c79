# Every verb creates and uses its own .venv from requirements.lock, once.
# .ci/find-python says with which Python; PYTHON=... on the command line or in the environment wins.
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/installed
ARGS ?=

.PHONY: help setup find-python system run test test-slow regress check docs format models clean

help:
	@echo "make setup      environment from the lock file, and what rendering needs of the system"
	@echo "                (PYTHON=/path/to/python3.13 chooses the Python, 3.12 or 3.13)"
	@echo "make run        set up, then assemble the motor unit in the twin; report in out/run (ARGS=... adds options)"
	@echo "make test       set up, then run the fast tests"
	@echo "make test-slow  long simulations"
	@echo "make regress    the paper's experiments, quick suite, against stored metrics"
	@echo "make check      style, types, documentation"
	@echo "make docs       the documentation as pages, in out/site"
	@echo "make format     rewrite the sources in the project's style"
	@echo "make models     write the generated models again"
	@echo "make clean      remove the environment and everything generated outside models/"

setup: system $(INSTALLED)

find-python:
	@.ci/find-python

run: setup
	$(BIN)/soft-jig assemble --out out/run $(ARGS)

test: setup
	$(BIN)/python -m pytest -n auto $(ARGS)

test-slow: $(INSTALLED)
	$(BIN)/python -m pytest -n auto -m slow $(ARGS)

regress: $(INSTALLED)
	$(BIN)/soft-jig regress --out out/regress $(ARGS)

check: $(INSTALLED) docs
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright

# Nothing is fetched; a broken link or reference is an error. The variable silences an announcement.
docs: $(INSTALLED)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict

format: $(INSTALLED)
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

models: $(INSTALLED)
	$(BIN)/python -m cell.cad
	$(BIN)/python -m cell.configuration

clean:
	rm -rf $(VENV) .uv build dist out *.egg-info .pytest_cache .ruff_cache .hypothesis
	find cell planning experiments tests -name __pycache__ -type d -prune -exec rm -rf {} +

# An environment of a Python that no longer suits, or no longer runs, is made anew.
# A Debian without the package python3-venv cannot put pip into an environment; its pip can.
$(INSTALLED): requirements.lock pyproject.toml
	@test -x $(BIN)/pip && PYTHON=$(BIN)/python .ci/find-python >/dev/null 2>&1 || { \
	  python=$$(.ci/find-python) && echo "$(VENV): $$("$$python" --version), $$python" && { \
	    "$$python" -m venv --clear $(VENV) || { \
	      "$$python" -m venv --clear --without-pip $(VENV) && \
	      "$$python" -m pip --python $(BIN)/python install pip; }; }; }
	$(BIN)/pip install -r requirements.lock
	$(BIN)/pip install -e . --no-deps
	@touch $@

# Drake needs the first of these; pictures without a display need the other two. Newer Debians
# provide libglib2.0-0 by a package of another name, which apt-get finds.
SYSTEM_PACKAGES := libglib2.0-0 libegl1 libgl1-mesa-dri
system:
	@if ldconfig -p | grep -q libglib-2.0.so.0 && ldconfig -p | grep -q libEGL.so.1 && \
	    dpkg -s libgl1-mesa-dri >/dev/null 2>&1; then \
	  true; \
	elif [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null && apt-get update -qq && \
	    apt-get install -y -qq --no-install-recommends $(SYSTEM_PACKAGES); then \
	  true; \
	else \
	  echo "Install $(SYSTEM_PACKAGES): the first for Drake, the others for pictures in the report"; \
	fi
