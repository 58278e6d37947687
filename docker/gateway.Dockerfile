# The gateway, and as the targets "drive" and "recorder" the drive program and the recorder. One switch, ROS: where rclpy comes from.
#   packages  the official ROS 2 image, arm64 and amd64: the robot
#   wheels    Debian 12 and the Python index's wheels, amd64: tests, and machines without a ROS image
# Everything above rclpy is the same.
ARG ROS=packages
# A tag, or better a tag with its digest (scripts/images digests).
ARG DEBIAN_IMAGE=debian:bookworm-slim
ARG ROS_IMAGE=ros:jazzy-ros-core

FROM ${DEBIAN_IMAGE} AS system-wheels
RUN --mount=type=bind,source=docker/packages,target=/run/packages /run/packages install python3 tini

FROM ${ROS_IMAGE} AS system-packages
RUN --mount=type=bind,source=docker/packages,target=/run/packages /run/packages install ros-jazzy-vision-msgs tini
# What sourcing setup.sh would set, for every process of the container and without a shell.
ENV AMENT_PREFIX_PATH=/opt/robot-gateway/ros:/opt/ros/jazzy \
    LD_LIBRARY_PATH=/opt/robot-gateway/ros/lib:/opt/ros/jazzy/lib:/opt/ros/jazzy/lib/aarch64-linux-gnu:/opt/ros/jazzy/lib/x86_64-linux-gnu \
    PYTHONPATH=/opt/robot-gateway/ros/lib/python3.12/site-packages:/opt/ros/jazzy/lib/python3.12/site-packages

FROM system-${ROS} AS system

FROM system AS tools
RUN --mount=type=bind,source=docker/packages,target=/run/packages /run/packages install cmake g++ ninja-build python3-dev python3-venv
WORKDIR /opt/robot-gateway
COPY docker/fetching.sh docker/
COPY requirements/tools.txt requirements/
RUN --mount=type=secret,id=ca --mount=type=secret,id=index . docker/fetching.sh \
 && python3 -m venv .cache/tools \
 && .cache/tools/bin/pip install --quiet --no-cache-dir --require-hashes -r requirements/tools.txt

FROM tools AS rclpy-wheels
COPY requirements/gateway.txt requirements/recorder.txt requirements/ros-wheels.txt requirements/interfaces-build.txt requirements/
RUN --mount=type=secret,id=ca --mount=type=secret,id=index . docker/fetching.sh \
 && python3 -m venv --without-pip .venv \
 && .cache/tools/bin/uv pip install --quiet --require-hashes --compile-bytecode --python .venv/bin/python \
      -r requirements/gateway.txt -r requirements/recorder.txt -r requirements/ros-wheels.txt
COPY interfaces interfaces
COPY scripts/build-interfaces scripts/
RUN --mount=type=secret,id=ca --mount=type=secret,id=index . docker/fetching.sh \
 && scripts/build-interfaces \
 && rm -rf .venv/include \
 && mkdir ros

FROM tools AS rclpy-packages
RUN --mount=type=bind,source=docker/packages,target=/run/packages /run/packages install ca-certificates git
COPY requirements/gateway.txt requirements/recorder.txt requirements/
RUN --mount=type=secret,id=ca --mount=type=secret,id=index . docker/fetching.sh \
 && python3 -m venv --without-pip --system-site-packages .venv \
 && .cache/tools/bin/uv pip install --quiet --require-hashes --compile-bytecode --python .venv/bin/python \
      -r requirements/gateway.txt -r requirements/recorder.txt
COPY interfaces/omniseer_msgs interfaces/omniseer_msgs
COPY docker/build-interfaces-ros docker/
# Release 4.6.1. A commit names its content, as a checksum does.
ARG YOLO_ROS_REPOSITORY=https://github.com/mgonzs13/yolo_ros.git
ARG YOLO_ROS_COMMIT=e712bdee9c5fcffb5e42a17b28792de004224964
RUN --mount=type=secret,id=ca --mount=type=secret,id=index . docker/fetching.sh \
 && docker/build-interfaces-ros

FROM rclpy-${ROS} AS built
# 1 for images that no robot runs: those of tests, and of a try without a robot. The wheels' environment has stand-ins.
ARG ALLOW_STAND_INS=
COPY docker/refuse-stand-ins docker/
RUN [ "$ALLOW_STAND_INS" = 1 ] || docker/refuse-stand-ins /opt
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
 && .venv/bin/robot-gateway --help > /dev/null

FROM system AS installed
# What is in the image, for a look at advisories: package and version, one line each.
RUN dpkg-query --show --showformat '${Package} ${Version}\n' > /usr/share/robot-gateway-packages.txt
COPY --from=built /opt/robot-gateway/ros /opt/robot-gateway/ros
COPY --from=built /opt/robot-gateway/.venv /opt/robot-gateway/.venv
ENV PATH=/opt/robot-gateway/.venv/bin:$PATH \
    PYTHONDONTWRITEBYTECODE=1 \
    HOME=/tmp
STOPSIGNAL SIGTERM
ENTRYPOINT ["tini", "--"]

# The drive program: the same layers, another user and another command.
FROM installed AS drive
RUN install -d -m 0700 -o 10003 -g 10000 /tmp /var/lib/robot-drive
ENV ROBOT_DRIVE_CONFIG=/etc/robot-gateway/drive.yaml \
    DRIVE__LOG_FORMAT=json \
    DRIVE__SOCKET=/run/robot-drive/drive.sock \
    DRIVE__STATE_DIR=/var/lib/robot-drive
# The group is shared with the gateway, which connects to the socket.
USER 10003:10000
HEALTHCHECK --interval=30s --timeout=5s --start-period=30s --retries=3 \
  CMD ["python", "-m", "drive.health"]
# The drive program has a guard of its own, which ends its worker; this one ends that guard when it hangs.
CMD ["python", "-m", "common.guard", "robot-drive", "serve", "--config", "/etc/robot-gateway/drive.yaml"]
ARG VERSION=0.0.0
ARG REVISION=unknown
LABEL org.opencontainers.image.title="robot-drive" \
      org.opencontainers.image.description="Moves a robot for an operator, and stops it on any doubt" \
      org.opencontainers.image.licenses="Apache-2.0" \
      org.opencontainers.image.version="${VERSION}" \
      org.opencontainers.image.revision="${REVISION}"

# The recorder: the same layers, another user and another command.
FROM installed AS recorder
RUN install -d -m 0700 -o 10004 -g 10000 /tmp \
 && install -d -m 0750 -o 10004 -g 10000 /var/lib/robot-recorder
ENV ROBOT_RECORDER_CONFIG=/etc/robot-gateway/recorder.yaml \
    RECORDER__LOG_FORMAT=json \
    RECORDER__SOCKET=/run/robot-recorder/recorder.sock \
    RECORDER__ROOT=/var/lib/robot-recorder \
    GRPC_VERBOSITY=ERROR
# The group is shared with the gateway, which connects to the socket, and with the preview, whose video it records.
USER 10004:10000
HEALTHCHECK --interval=30s --timeout=5s --start-period=60s --retries=3 \
  CMD ["python", "-m", "recorder.health"]
CMD ["python", "-m", "common.guard", "robot-recorder", "serve", "--config", "/etc/robot-gateway/recorder.yaml"]
ARG VERSION=0.0.0
ARG REVISION=unknown
LABEL org.opencontainers.image.title="robot-recorder" \
      org.opencontainers.image.description="Records a robot's topics and video, and keeps room on its disk" \
      org.opencontainers.image.licenses="Apache-2.0" \
      org.opencontainers.image.version="${VERSION}" \
      org.opencontainers.image.revision="${REVISION}"

FROM installed AS gateway
# Volumes take over whose these are; so does a tmpfs on /tmp, whatever mode it is given, before runc 1.1.8.
RUN install -d -m 0700 -o 10001 -g 10000 /tmp /var/lib/robot-gateway/credentials /var/lib/robot-gateway/audit
ENV ROBOT_GATEWAY_CONFIG=/etc/robot-gateway/gateway.yaml \
    GATEWAY__LOG_FORMAT=json \
    GRPC_VERBOSITY=ERROR \
    HEALTH_TARGET=127.0.0.1:50051 \
    HEALTH_SERVICE=omniseer.gateway.v1.RobotGateway
# The group is shared with the preview: it owns the socket between the two.
USER 10001:10000
HEALTHCHECK --interval=10s --timeout=5s --start-period=20s --retries=3 \
  CMD ["python", "-m", "common.healthcheck"]
# Docker restarts what has ended, not what is unhealthy: the guard ends a program that hangs.
CMD ["python", "-m", "common.guard", "robot-gateway", "serve", "--config", "/etc/robot-gateway/gateway.yaml"]
# Last, because they change with every commit and nothing above does.
ARG VERSION=0.0.0
ARG REVISION=unknown
ENV ROBOT_GATEWAY_REVISION=${REVISION}
LABEL org.opencontainers.image.title="robot-gateway" \
      org.opencontainers.image.description="One typed door between a ROS 2 robot and its operator" \
      org.opencontainers.image.licenses="Apache-2.0" \
      org.opencontainers.image.version="${VERSION}" \
      org.opencontainers.image.revision="${REVISION}"
