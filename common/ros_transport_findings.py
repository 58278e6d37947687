"""What the doctors say of how messages travel: whether nodes of other users could be heard. Needs no ROS."""

import fcntl
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from common.findings import Finding, good, note, wrong
from common.ros_transport import VARIABLE

CHECK: Final = "ros.transport"
_MEMORY: Final = Path("/dev/shm")  # noqa: S108  # Fast DDS's own place, which is only listed
_PORT_LOCK: Final = re.compile(r"fastrtps_port(\d{1,5})_el")
"""The lock of a port at which a node is reached through shared memory; the node holds it while it runs.
The number is that of the UDP port that the node would have."""
_PORT_BASE: Final = 7400
_PORTS_OF_A_DOMAIN: Final = 250
"""RTPS 2.3, 9.6.1: ports of a domain begin at PB + DG * domain."""
_WITHOUT_MEMORY: Final = frozenset({"UDPV4", "UDPV6"})
_NAMED: Final = 4


def transport_finding(middleware: str, memory: Path = _MEMORY) -> Iterator[Finding]:
    """Yields what is known of the transport of this process's nodes.

    Args:
        middleware: its name: "rmw_fastrtps_cpp" for example. Yields nothing for others than Fast DDS.
        memory: where Fast DDS keeps its shared memory.
    """
    if not middleware.startswith("rmw_fastrtps"):
        return
    if os.environ.get("FASTRTPS_DEFAULT_PROFILES_FILE"):
        yield note(
            CHECK,
            "FASTRTPS_DEFAULT_PROFILES_FILE decides how messages travel",
            "With shared memory in it, nothing arrives from nodes of other users",
            f"Unset it, and set {VARIABLE}=udp, unless all nodes run as one user",
        )
        return
    chosen = os.environ.get("FASTDDS_BUILTIN_TRANSPORTS", "").strip().upper()
    if chosen in _WITHOUT_MEMORY or (not chosen and os.environ.get(VARIABLE, "").strip().lower() == "udp"):
        yield good(CHECK, "messages travel over UDP, from nodes of any user")
        return
    others = _others(memory)
    if not others:
        yield good(CHECK, "no node of another user was seen in the shared memory of Fast DDS")
        return
    users = ", ".join(str(user) for user in others[:_NAMED])
    yield wrong(
        CHECK,
        f"nodes of other users use the shared memory of Fast DDS in this domain (user {users}), and so does"
        f" user {os.geteuid()}",
        "Between two users it delivers nothing, without an error: topics are discovered and stay silent",
        f"Set {VARIABLE}=udp in the environment of this program"
        + ("" if not chosen else ", and unset FASTDDS_BUILTIN_TRANSPORTS"),
    )


def _others(memory: Path) -> list[int]:
    """Returns the users, other than this process's, of nodes of this domain that can be reached there."""
    try:
        domain = int(os.environ.get("ROS_DOMAIN_ID", "").strip() or "0")
        files = list(os.scandir(memory))
    except (OSError, ValueError):
        return []
    begin = _PORT_BASE + _PORTS_OF_A_DOMAIN * domain
    users: set[int] = set()
    for file in files:
        port = _PORT_LOCK.fullmatch(file.name)
        if port and begin <= int(port[1]) < begin + _PORTS_OF_A_DOMAIN:
            holder = _holder(Path(file.path))
            users |= {holder} if holder is not None else set()
    return sorted(users - {os.geteuid()})


def _holder(lock: Path) -> int | None:
    """Returns the user whose node holds a lock; None if nothing holds it, or if it can't be read."""
    try:
        # Whatever has been put there: neither followed nor waited for.
        descriptor = os.open(lock, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return None
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return os.fstat(descriptor).st_uid
    except OSError:
        return None
    finally:
        os.close(descriptor)
    return None
