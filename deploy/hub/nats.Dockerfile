# nats-server without anything else that runs. Two sources: the official image, or Debian's package.
ARG NATS_IMAGE=nats:2.15.1
ARG DEBIAN_IMAGE=debian:bookworm-slim

FROM ${DEBIAN_IMAGE} AS base
# The streams' directory belongs to the server; a new volume on it takes over these rights.
RUN groupadd --gid 10020 nats \
 && useradd --uid 10020 --gid 10020 --no-create-home --shell /usr/sbin/nologin nats \
 && install -d -m 0700 -o 10020 -g 10020 /var/lib/nats \
 && install -d -m 0755 /etc/nats
# What is in the image, for a look at advisories: package and version, one line each.
RUN dpkg-query --show --showformat '${Package} ${Version}\n' > /usr/share/robot-gateway-packages.txt
COPY --chmod=0755 healthy /usr/local/bin/healthy
HEALTHCHECK --interval=5s --timeout=3s --start-period=30s --retries=3 CMD ["healthy"]
ENTRYPOINT ["nats-server", "--config", "/etc/nats/nats.conf"]

FROM ${NATS_IMAGE} AS released

FROM base AS official
COPY --from=released /nats-server /usr/sbin/nats-server
RUN version="$(nats-server --version)" \
 && echo "nats-server ${version##* v}" >> /usr/share/robot-gateway-packages.txt
USER 10020:10020

FROM ${DEBIAN_IMAGE} AS packaged
WORKDIR /tmp/package
RUN apt-get update && apt-get download nats-server && dpkg --extract nats-server_*.deb .

FROM base AS debian
RUN --mount=type=bind,from=packaged,source=/tmp/package,target=/tmp/package \
    dpkg-deb --show --showformat '${Package} ${Version}\n' /tmp/package/*.deb >> /usr/share/robot-gateway-packages.txt
COPY --from=packaged /tmp/package/usr/sbin/nats-server /usr/sbin/nats-server
USER 10020:10020
