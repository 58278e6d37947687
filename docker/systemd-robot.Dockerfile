# A robot without Docker, for tests: Debian 12 with systemd as its first process, and with what scripts/install-robot has
# installed there before systemd ran, as in the image of an SD card. ROS comes from the Python index's wheels.
# docker/systemd-robot builds it.
ARG DEBIAN_IMAGE=debian:bookworm-slim

FROM ${DEBIAN_IMAGE}
WORKDIR /robot-gateway
COPY requirements/debian-robot.txt requirements/
# Beside what the robot needs: systemd, and what the messages are built with where ROS comes from wheels.
RUN apt-get update \
 && sed -e 's/ *#.*//' requirements/debian-robot.txt | xargs apt-get install -y --no-install-recommends \
      cmake g++ ninja-build procps python3-dev systemd udev util-linux \
 && rm -rf /var/lib/apt/lists/* /var/cache/apt/*
COPY . .
RUN --mount=type=secret,id=ca --mount=type=secret,id=index . docker/fetching.sh \
 # The cache stays, for an upgrade without a network.
 && unset UV_NO_CACHE UV_LINK_MODE \
 && scripts/install-robot --ros wheels
STOPSIGNAL SIGRTMIN+3
CMD ["/lib/systemd/systemd", "--show-status=false"]
