"""Settings that must be in the environment before numpy and matplotlib are imported."""

import os

# The suite runs one process per core: more threads inside each would only wait for one another.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("MPLBACKEND", "Agg")
