# Debian 13 with this tree, set up as scripts/setup does it there: Python 3.13, GStreamer 1.26. docker/debian-13 builds it
# and runs the tests in it.
ARG DEBIAN_13_IMAGE=debian:trixie-slim

FROM ${DEBIAN_13_IMAGE}
WORKDIR /robot-gateway
COPY requirements/debian.txt requirements/
RUN apt-get update \
 && sed -e 's/#.*//' requirements/debian.txt | xargs apt-get install -y --no-install-recommends \
 && rm -rf /var/lib/apt/lists/* /var/cache/apt/*
COPY pyproject.toml README.md LICENSE ./
COPY requirements requirements
COPY interfaces interfaces
COPY docker/fetching.sh docker/
COPY scripts/setup scripts/build-interfaces scripts/package-index.sh scripts/
RUN --mount=type=secret,id=ca --mount=type=secret,id=index . docker/fetching.sh && scripts/setup
COPY . .
