"""A network behind a bad link, on this machine: what sits in it is reached through that link only."""

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from bench.video import foreign

_ROBOT, _VIEWER = "10.203.7.1", "10.203.7.2"


@dataclass(frozen=True, slots=True)
class BadLink:
    """A link that is up.

    Args:
        robot: address on the near side, where the robot listens.
        enter: what to put before a command so that it runs on the far side.
    """

    robot: str
    enter: tuple[str, ...]


def possible() -> bool:
    """Whether this user may make networks."""
    return os.geteuid() == 0


@contextmanager
def bad_link(*, rate_kbps: int | None = None, loss_percent: int = 0) -> Iterator[BadLink]:
    """A link from the robot to the viewer, until the block ends.

    Args:
        rate_kbps: what it carries towards the viewer; None: anything.
        loss_percent: how many packets towards the viewer it loses, at random.

    Raises:
        CalledProcessError: the system has no network namespaces, tc or nft.
    """
    name = f"bench{os.getpid()}"
    near, far = f"{name}n", f"{name}f"
    inside = ("ip", "netns", "exec", name)
    _do("ip", "netns", "add", name)
    try:
        _do("ip", "link", "add", near, "type", "veth", "peer", "name", far, "netns", name)
        _do("ip", "addr", "add", f"{_ROBOT}/30", "dev", near)
        _do("ip", "link", "set", near, "up")
        _do(*inside, "ip", "addr", "add", f"{_VIEWER}/30", "dev", far)
        _do(*inside, "ip", "link", "set", far, "up")
        if rate_kbps:
            limit = ("rate", f"{rate_kbps}kbit", "burst", "16kb", "latency", "200ms")
            _do("tc", "qdisc", "add", "dev", near, "root", "tbf", *limit)
        if loss_percent:
            _do(*inside, "nft", "add", "table", "ip", "bench")
            hook = "{ type filter hook input priority 0 ; }"
            _do(*inside, "nft", "add", "chain", "ip", "bench", "arriving", hook)
            luck = ("numgen", "random", "mod", "100", "<", str(loss_percent), "drop")
            _do(*inside, "nft", "add", "rule", "ip", "bench", "arriving", *luck)
        yield BadLink(_ROBOT, inside)
    finally:
        # The pair of interfaces goes with the namespace.
        _do("ip", "netns", "del", name)


def _do(*command: str) -> None:
    subprocess.run(command, env=foreign.environment(), check=True)
