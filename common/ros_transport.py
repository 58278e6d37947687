"""How Fast DDS carries messages: over UDP where its shared memory does not do.

Three reasons, all of Fast DDS 2.14. Its segments in /dev/shm are writable for their owner alone, and a reader
has to write to those of a publisher: between nodes of two users nothing arrives, and no error says so. It
waits for up to a second for the port of a process that has just joined or ended
(SharedMemGlobal::open_port_internal), and holds a lock meanwhile that each message of this process needs: a
node that starts anywhere on the robot would stop a robot that is being driven. And the process that takes the
place of one that was killed while it handled a message makes its port anew, while a publisher may go on
filling the old one, which no check finds dead: the new process hears nothing of that publisher, however often
it is started, until the publisher ends.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from common.errors import ExitCode, UserError

VARIABLE: Final = "ROBOT_ROS_TRANSPORT"
"""Set to "udp" where the robot's own nodes run as other users. Otherwise the middleware decides."""

_CHOSEN: Final = ("FASTDDS_BUILTIN_TRANSPORTS", "FASTRTPS_DEFAULT_PROFILES_FILE")
"""Environment variables by which others choose transports; their choice counts."""
_RANGE: Final = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_PORTS: Final = 32
"""Participants on this machine that are found; as with ROS 2's own range LOCALHOST."""
_LOCALHOST_OVER_UDP: Final = f"""\
<?xml version="1.0" encoding="UTF-8"?>
<profiles xmlns="http://www.eprosima.com">
  <transport_descriptors>
    <transport_descriptor>
      <transport_id>udp</transport_id>
      <type>UDPv4</type>
      <maxInitialPeersRange>{_PORTS}</maxInitialPeersRange>
    </transport_descriptor>
  </transport_descriptors>
  <participant profile_name="localhost_over_udp" is_default_profile="true">
    <rtps>
      <builtin>
        <metatrafficUnicastLocatorList><locator/></metatrafficUnicastLocatorList>
        <initialPeersList>
          <locator><udpv4><address>127.0.0.1</address></udpv4></locator>
        </initialPeersList>
      </builtin>
      <userTransports><transport_id>udp</transport_id></userTransports>
      <useBuiltinTransports>false</useBuiltinTransports>
    </rtps>
  </participant>
</profiles>
"""
"""What rmw_fastrtps sets for the range LOCALHOST, without the shared memory that it adds to any profile."""


def use_udp(directory: Path) -> None:
    """Makes the nodes of this process and of its children use UDP; must be called before the first.

    Other middlewares ignore it.

    Args:
        directory: for a file of profiles.

    Raises:
        UserError: the file can't be written.
    """
    if any(os.environ.get(name) for name in _CHOSEN):
        return
    if os.environ.get(_RANGE, "").upper() != "LOCALHOST":
        os.environ["FASTDDS_BUILTIN_TRANSPORTS"] = "UDPv4"
        return
    profiles = directory / "fastdds.xml"
    try:
        profiles.write_text(_LOCALHOST_OVER_UDP, encoding="utf-8")
    except OSError as error:
        raise UserError(
            f"{profiles} can't be written ({error.strerror})", "Make state_dir writable"
        ) from error
    os.environ["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(profiles)
    os.environ[_RANGE] = "SYSTEM_DEFAULT"


@contextmanager
def chosen_transport() -> Iterator[None]:
    """Makes the nodes that are made in the block use UDP if the environment asks for it.

    Raises:
        UserError: the environment asks for something else, or there is no room for a file of profiles.
    """
    chosen = os.environ.get(VARIABLE, "").strip().lower()
    if not chosen:
        yield
        return
    if chosen != "udp":
        raise UserError(f"{VARIABLE} is '{chosen}'", "Set it to udp, or to nothing", exit_code=ExitCode.USAGE)
    before = {name: os.environ.get(name) for name in (*_CHOSEN, _RANGE)}
    with TemporaryDirectory(prefix="fastdds-") as directory:
        use_udp(Path(directory))
        try:
            yield
        finally:
            for name, value in before.items():
                if value is None:
                    os.environ.pop(name, None)
                else:
                    os.environ[name] = value
