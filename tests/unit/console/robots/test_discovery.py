"""What of an announcement counts as a robot, and which are left out; nothing here uses a network."""

from types import SimpleNamespace
from typing import Any

import pytest
from zeroconf import ServiceStateChange
from zeroconf.asyncio import AsyncServiceInfo

from common.advertisement import SERVICE_TYPE
from console.robots.discovery import Discovery, robot_in


class Network:
    """Takes the place of zeroconf; nothing can be asked on it."""

    def __init__(self, **_interfaces: Any) -> None:
        self.loop = None


@pytest.fixture
def discovery(monkeypatch: pytest.MonkeyPatch) -> Discovery:
    monkeypatch.setattr("console.robots.discovery.Zeroconf", Network)
    monkeypatch.setattr("console.robots.discovery.ServiceBrowser", lambda *_, **__: SimpleNamespace())
    return Discovery()


@pytest.mark.parametrize(
    "name",
    [
        *("", "x", "lab.local.", "lab._other._tcp.local.", "lab._._tcp.local.", SERVICE_TYPE),
        *(f"{'x' * 64}.{SERVICE_TYPE}", f"\x1b]0;owned\x07.{SERVICE_TYPE}", f"lab.{SERVICE_TYPE.upper()}"),
    ],
)
def test_a_name_that_is_none_of_this_service_is_left_out_and_ends_nothing(
    discovery: Discovery, name: str
) -> None:
    """Zeroconf's thread, which calls this, ends for good with an exception: no robot was found after it."""
    discovery._on_change(Network(), SERVICE_TYPE, name, ServiceStateChange.Added)  # type: ignore[arg-type]
    assert discovery._found == {}
    good = f"lab 1.{SERVICE_TYPE}"
    discovery._on_change(Network(), SERVICE_TYPE, good, ServiceStateChange.Added)  # type: ignore[arg-type]
    assert list(discovery._found) == [good]


@pytest.mark.parametrize(
    ("address", "target"),
    [
        ("10.0.0.2", "10.0.0.2:50051"),
        ("2001:db8::2", "[2001:db8::2]:50051"),
        *((each, None) for each in ("127.0.0.1", "::1", "0.0.0.0", "::", "224.0.0.1", "ff02::1")),  # noqa: S104
        # IPv4 in the form of IPv6 (RFC 4291 2.5.5.2): connections to it are IPv4's.
        *((f"::ffff:{each}", None) for each in ("127.0.0.1", "0.0.0.0", "224.0.0.1")),  # noqa: S104
    ],
)
def test_an_address_must_be_another_machines(address: str, target: str | None) -> None:
    info = AsyncServiceInfo(
        SERVICE_TYPE, f"lab.{SERVICE_TYPE}", 50051, properties={}, parsed_addresses=[address]
    )
    robot = robot_in(info, loopback=False)
    assert (robot and robot.target) == target
