# The receiver of recordings and the exporter of metrics, on Debian 12.
ARG DEBIAN_IMAGE=debian:bookworm-slim

FROM ${DEBIAN_IMAGE} AS system
RUN --mount=type=bind,source=docker/packages,target=/run/packages /run/packages install python3 tini

FROM ${DEBIAN_IMAGE} AS built
RUN --mount=type=bind,source=docker/packages,target=/run/packages /run/packages install python3-venv
WORKDIR /opt/robot-gateway
COPY docker/fetching.sh docker/
COPY requirements/tools.txt requirements/hub.txt requirements/
RUN --mount=type=secret,id=ca --mount=type=secret,id=index . docker/fetching.sh \
 && python3 -m venv .cache/tools \
 && .cache/tools/bin/pip install --quiet --no-cache-dir --require-hashes -r requirements/tools.txt \
 && python3 -m venv --without-pip .venv \
 && .cache/tools/bin/uv pip install --quiet --require-hashes --no-deps --compile-bytecode --python .venv/bin/python \
      -r requirements/hub.txt
COPY pyproject.toml README.md LICENSE ./
COPY bridge bridge
COPY common common
COPY console console
COPY drive drive
COPY fleet fleet
COPY gateway gateway
COPY hub hub
COPY practice practice
COPY preview preview
COPY recorder recorder
COPY simrobot simrobot
COPY tap tap
COPY proto/python proto/python
RUN .cache/tools/bin/python -m hatchling build -t wheel \
 # Without a note of when that was.
 && UV_NO_INSTALLER_METADATA=1 .cache/tools/bin/uv pip install --quiet --offline --no-deps --compile-bytecode \
      --python .venv/bin/python dist/*.whl \
 && .venv/bin/robot-bridge hub --help > /dev/null

FROM system
# What is in the image, for a look at advisories: package and version, one line each.
RUN dpkg-query --show --showformat '${Package} ${Version}\n' > /usr/share/robot-gateway-packages.txt
COPY --from=built /opt/robot-gateway/.venv /opt/robot-gateway/.venv
RUN install -d -m 0700 -o 10021 -g 10021 /tmp
ENV PATH=/opt/robot-gateway/.venv/bin:$PATH \
    RECEIVER__LOG_FORMAT=json \
    PYTHONDONTWRITEBYTECODE=1 \
    HOME=/tmp
ARG VERSION=0.0.0
ARG REVISION=unknown
LABEL org.opencontainers.image.version=${VERSION} org.opencontainers.image.revision=${REVISION}
USER 10021:10021
ENTRYPOINT ["tini", "--"]
