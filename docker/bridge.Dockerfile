# The bridge to the fleet, on Debian 12: it needs neither ROS nor GStreamer.
# A tag, or better a tag with its digest (scripts/images digests).
ARG DEBIAN_IMAGE=debian:bookworm-slim

FROM ${DEBIAN_IMAGE} AS system
# The certificates: of stores whose authority the world knows (uploads.ca names any other). tzdata: the zones of
# uploads.time_zone.
RUN --mount=type=bind,source=docker/packages,target=/run/packages /run/packages install ca-certificates python3 tini tzdata

FROM ${DEBIAN_IMAGE} AS built
RUN --mount=type=bind,source=docker/packages,target=/run/packages /run/packages install python3-venv
WORKDIR /opt/robot-gateway
COPY docker/fetching.sh docker/
COPY requirements/tools.txt requirements/bridge.txt requirements/
RUN --mount=type=secret,id=ca --mount=type=secret,id=index . docker/fetching.sh \
 && python3 -m venv .cache/tools \
 && .cache/tools/bin/pip install --quiet --no-cache-dir --require-hashes -r requirements/tools.txt \
 && python3 -m venv --without-pip .venv \
 && .cache/tools/bin/uv pip install --quiet --require-hashes --no-deps --compile-bytecode --python .venv/bin/python \
      -r requirements/bridge.txt
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
 && .venv/bin/robot-bridge --help > /dev/null

FROM system
# What is in the image, for a look at advisories: package and version, one line each.
RUN dpkg-query --show --showformat '${Package} ${Version}\n' > /usr/share/robot-gateway-packages.txt
COPY --from=built /opt/robot-gateway/.venv /opt/robot-gateway/.venv
# A volume or a tmpfs on it takes over these rights.
RUN install -d -m 0700 -o 10005 -g 10000 /tmp /var/lib/robot-bridge
ENV PATH=/opt/robot-gateway/.venv/bin:$PATH \
    ROBOT_BRIDGE_CONFIG=/etc/robot-gateway/bridge.yaml \
    BRIDGE__LOG_FORMAT=json \
    BRIDGE__SOCKET=/run/robot-bridge/bridge.sock \
    BRIDGE__ROOT=/var/lib/robot-bridge \
    GRPC_VERBOSITY=ERROR \
    PYTHONDONTWRITEBYTECODE=1 \
    HOME=/tmp
# The group is shared with the gateway, which connects to the socket.
USER 10005:10000
STOPSIGNAL SIGTERM
# The check shares half a processor with the program (BRIDGE_CPUS).
HEALTHCHECK --interval=30s --timeout=10s --start-period=30s --retries=3 \
  CMD ["python", "-m", "bridge.health"]
ENTRYPOINT ["tini", "--"]
# Docker restarts what has ended, not what is unhealthy: the guard ends a program that hangs.
CMD ["python", "-m", "common.guard", "robot-bridge", "serve", "--config", "/etc/robot-gateway/bridge.yaml"]
# Last, because they change with every commit and nothing above does.
ARG VERSION=0.0.0
ARG REVISION=unknown
LABEL org.opencontainers.image.title="robot-bridge" \
      org.opencontainers.image.description="Takes a robot's state, events and recordings to its fleet's hub" \
      org.opencontainers.image.licenses="Apache-2.0" \
      org.opencontainers.image.version="${VERSION}" \
      org.opencontainers.image.revision="${REVISION}"
