# The twin without a display: docker build -t soft-jig . && docker run -v "$PWD/out:/out" soft-jig
FROM python:3.13-slim-bookworm

# Drake loads libglib; the last two draw the pictures of the report.
RUN apt-get update \
 && apt-get install -y --no-install-recommends make libglib2.0-0 libegl1 libgl1-mesa-dri \
 && rm -rf /var/lib/apt/lists/*

WORKDIR /soft-jig
COPY . .
ENV PIP_NO_CACHE_DIR=1
RUN make setup PYTHON=/usr/local/bin/python3.13
ENV PATH="/soft-jig/.venv/bin:$PATH"

# Another command takes its place: docker run -v "$PWD/out:/out" soft-jig soft-jig plan motor_unit --explain --out /out
CMD ["soft-jig", "assemble", "--out", "/out"]
