# The preview, on Debian 12: the system whose GStreamer the boards' makers build their encoder plugins for.
# EXTRA_PACKAGES adds Debian packages (drivers), docker/vendor/ packages of the board's maker.
# A tag, or better a tag with its digest (scripts/images digests).
ARG DEBIAN_IMAGE=debian:bookworm-slim

FROM ${DEBIAN_IMAGE} AS system
ARG EXTRA_PACKAGES=""
RUN --mount=type=bind,source=docker/packages,target=/run/packages \
    /run/packages install \
      gir1.2-gst-plugins-base-1.0 gir1.2-gstreamer-1.0 \
      gstreamer1.0-plugins-bad gstreamer1.0-plugins-base gstreamer1.0-plugins-good gstreamer1.0-plugins-ugly \
      python3 python3-gi tini ${EXTRA_PACKAGES}
RUN --mount=type=bind,source=docker/packages,target=/run/packages \
    --mount=type=bind,source=docker/vendor,target=/mnt \
    if ls /mnt/*.deb > /dev/null 2>&1; then /run/packages install /mnt/*.deb; fi

FROM ${DEBIAN_IMAGE} AS built
RUN --mount=type=bind,source=docker/packages,target=/run/packages /run/packages install python3-venv
WORKDIR /opt/robot-gateway
COPY docker/fetching.sh docker/
COPY requirements/tools.txt requirements/preview-image.txt requirements/
RUN --mount=type=secret,id=ca --mount=type=secret,id=index . docker/fetching.sh \
 && python3 -m venv .cache/tools \
 && .cache/tools/bin/pip install --quiet --no-cache-dir --require-hashes -r requirements/tools.txt \
 && python3 -m venv --without-pip --system-site-packages .venv \
 && .cache/tools/bin/uv pip install --quiet --require-hashes --no-deps --compile-bytecode --python .venv/bin/python \
      -r requirements/preview-image.txt
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
 && .venv/bin/robot-preview --help > /dev/null

FROM system
# What is in the image, for a look at advisories: package and version, one line each.
RUN dpkg-query --show --showformat '${Package} ${Version}\n' > /usr/share/robot-gateway-packages.txt
COPY --from=built /opt/robot-gateway/.venv /opt/robot-gateway/.venv
# A tmpfs on it takes over these rights, whatever mode it is given, before runc 1.1.8.
RUN install -d -m 0700 -o 10002 -g 10000 /tmp
# The registry is made anew by every container: one made where the encoder's device was missing keeps hiding it.
ENV PATH=/opt/robot-gateway/.venv/bin:$PATH \
    ROBOT_PREVIEW_CONFIG=/etc/robot-gateway/preview.yaml \
    PREVIEW__LOG_FORMAT=json \
    PYTHONDONTWRITEBYTECODE=1 \
    HOME=/tmp \
    XDG_RUNTIME_DIR=/tmp \
    GST_REGISTRY=/tmp/gstreamer-registry.bin \
    HEALTH_TARGET=unix:/run/robot-gateway/preview.sock
USER 10002:10000
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=10s --timeout=5s --start-period=20s --retries=3 \
  CMD ["python", "-m", "common.healthcheck"]
ENTRYPOINT ["tini", "--"]
# Docker restarts what has ended, not what is unhealthy: the guard ends a program that hangs.
CMD ["python", "-m", "common.guard", "robot-preview", "serve", "--config", "/etc/robot-gateway/preview.yaml"]
# Last, because they change with every commit and nothing above does.
ARG VERSION=0.0.0
ARG REVISION=unknown
LABEL org.opencontainers.image.title="robot-preview" \
      org.opencontainers.image.description="Live video of a robot, on demand over SRT" \
      org.opencontainers.image.licenses="Apache-2.0" \
      org.opencontainers.image.version="${VERSION}" \
      org.opencontainers.image.revision="${REVISION}"
