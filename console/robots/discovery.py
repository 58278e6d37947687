"""Gateways that announce themselves on this computer's networks by mDNS and DNS-SD (RFC 6762, RFC 6763).

Nothing here is trusted: any machine can announce anything. Announcements are bounded in number and length,
made safe for a terminal, and reduced to an address and hints; a login authenticates the robot as ever.
"""

import asyncio
import ipaddress
import threading
import time
from collections.abc import Iterable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass
from types import TracebackType
from typing import Final, Self

from zeroconf import (
    BadTypeInNameException,
    InterfaceChoice,
    ServiceBrowser,
    ServiceStateChange,
    Zeroconf,
)
from zeroconf.asyncio import AsyncServiceInfo

from common.advertisement import SERVICE_TYPE, advertisement_from
from common.errors import ExitCode, UserError
from common.plain_name import plain_name
from common.printable import printable

ADDRESSES_VARIABLE: Final = "ROBOTCTL_DISCOVERY"
MOST_ROBOTS: Final = 64
"""Of a list for people; more announcements are not looked at."""
MOST_CHANGES: Final = 4096
"""Announcements and withdrawals after which a flood is assumed and the search ends."""
_LONGEST_NAME: Final = 63
_ASK_WITHIN_MS: Final = 1500.0


@dataclass(frozen=True, slots=True, order=True)
class DiscoveredRobot:
    """A gateway that was announced. All of it is hearsay.

    Args:
        name: Of the robot's gateway, for people.
        target: HOST:PORT for `--target`; the host is an IP address.
        tls: Whether it says that connections are encrypted and callers authenticated.
        contract: The contract that it says it serves, omniseer.gateway.v1 for example.
    """

    name: str
    target: str
    tls: bool
    contract: str

    @property
    def nickname(self) -> str:
        """A name that `robotctl robots add` accepts."""
        return plain_name(self.name, _LONGEST_NAME, also="_").lower()

    @property
    def login_command(self) -> str:
        """What stores a login for it; FILE is what its administrator has given."""
        return f"robotctl login {self.nickname} {self.target} FILE"


class Discovery:
    """A search that lasts as long as its `with` block; `robots` is what was found so far.

    Any thread may read it. For a list in a window: as long as the list is open, not longer.

    Args:
        addresses: Of this computer, on whose networks is searched; empty: on all of them.

    Raises:
        UserError: This computer has no network for it.
    """

    def __init__(self, addresses: Iterable[str] = ()) -> None:
        addresses = tuple(addresses)
        self._local = bool(addresses) and all(ipaddress.ip_address(each).is_loopback for each in addresses)
        self._lock = threading.Lock()
        self._found: dict[str, DiscoveredRobot | None] = {}
        self._changes = 0
        self._asking: set[Future[None]] = set()
        try:
            self._zeroconf = Zeroconf(interfaces=list(addresses) or InterfaceChoice.All)
        except OSError as error:
            raise UserError(
                f"this computer can't search its networks: {error.strerror or error}",
                "Use the robot's address, HOST:PORT",
            ) from error
        self._browser = ServiceBrowser(self._zeroconf, SERVICE_TYPE, handlers=[self._on_change])

    @property
    def robots(self) -> tuple[DiscoveredRobot, ...]:
        """What was found so far, each address once, sorted by name."""
        with self._lock:
            found = [robot for robot in self._found.values() if robot]
        return tuple(sorted({robot.target: robot for robot in found}.values()))

    @property
    def truncated(self) -> bool:
        """Whether more was announced than is kept."""
        with self._lock:
            return len(self._found) >= MOST_ROBOTS or self._changes > MOST_CHANGES

    def close(self) -> None:
        """Ends the search; `robots` stays readable."""
        with self._lock:
            asking = tuple(self._asking)
        for each in asking:
            each.cancel()
        self._browser.cancel()
        self._zeroconf.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _on_change(
        self, zeroconf: Zeroconf, service_type: str, name: str, state_change: ServiceStateChange
    ) -> None:
        """Called in a thread of zeroconf's."""
        info = question(service_type, name)
        with self._lock:
            self._changes += 1
            if info is None:
                return
            if state_change is ServiceStateChange.Removed:
                self._found.pop(name, None)
                return
            full = name not in self._found and len(self._found) >= MOST_ROBOTS
            if full or self._changes > MOST_CHANGES:
                return
            self._found.setdefault(name, None)
        loop = zeroconf.loop
        if loop is None or loop.is_closed():
            return
        asking = asyncio.run_coroutine_threadsafe(self._ask(info), loop)
        with self._lock:
            self._asking.add(asking)
        asking.add_done_callback(self._asked)

    def _asked(self, asking: Future[None]) -> None:
        with self._lock:
            self._asking.discard(asking)

    async def _ask(self, info: AsyncServiceInfo) -> None:
        """Asks for address and properties of a name, where the announcement did not have them."""
        if not await info.async_request(self._zeroconf, _ASK_WITHIN_MS):
            return
        robot = robot_in(info, loopback=self._local)
        with self._lock:
            if info.name in self._found:
                self._found[info.name] = robot


def addresses_in(environment: Mapping[str, str]) -> tuple[str, ...]:
    """Returns the addresses of $ROBOTCTL_DISCOVERY, separated by commas: those to search from; empty: all.

    Raises:
        UserError: One of them is none.
    """
    addresses = tuple(filter(None, environment.get(ADDRESSES_VARIABLE, "").replace(" ", "").split(",")))
    for each in addresses:
        try:
            ipaddress.ip_address(each)
        except ValueError:
            raise UserError(
                f"{ADDRESSES_VARIABLE} has '{each}', which is not an IP address",
                "Name addresses of this computer, separated by commas: 10.0.0.2,192.0.2.2 for example",
                exit_code=ExitCode.USAGE,
            ) from None
    return addresses


def discover(within_s: float, addresses: Iterable[str] = ()) -> tuple[tuple[DiscoveredRobot, ...], bool]:
    """Searches for some time. Returns what was found, and whether there was more.

    Args:
        within_s: How long.
        addresses: As of `Discovery`.

    Raises:
        UserError: As of `Discovery`.
    """
    with Discovery(addresses) as discovery:
        time.sleep(within_s)
        return discovery.robots, discovery.truncated


def question(service_type: str, name: str) -> AsyncServiceInfo | None:
    """Returns what asks for the records of a name; None where it is no instance of the service.

    Anything may be announced as one (RFC 6763 4.1 has the form), and an exception would end the thread of
    zeroconf that hands names over.
    """
    if not name.endswith(f".{service_type}"):
        return None
    try:
        return AsyncServiceInfo(service_type, name)
    except BadTypeInNameException:
        return None


def robot_in(info: AsyncServiceInfo, *, loopback: bool) -> DiscoveredRobot | None:
    """Returns a robot of an announcement; None if it has no address to call."""
    announced = advertisement_from(info.properties)
    addresses = [each for each in info.parsed_scoped_addresses() if _is_callable(each, loopback=loopback)]
    if not addresses or not info.port:
        return None
    # IPv4 first: an IPv6 address of a link needs its scope, which not every tool takes.
    address = min(addresses, key=lambda each: ":" in each)
    host = f"[{address}]" if ":" in address else address
    name = " ".join(printable(announced.name or info.get_name()).split())[:_LONGEST_NAME]
    return DiscoveredRobot(
        name or "robot", f"{host}:{info.port}", announced.tls, printable(announced.contract)[:_LONGEST_NAME]
    )


def _is_callable(text: str, *, loopback: bool) -> bool:
    """Returns whether an address can be another machine's: an announcement must not name this computer."""
    address = ipaddress.ip_address(text)
    if isinstance(address, ipaddress.IPv6Address) and address.ipv4_mapped:
        # ::ffff:127.0.0.1 is this computer as well, which `ipaddress` knows from Python 3.13 on.
        address = address.ipv4_mapped
    return not (address.is_multicast or address.is_unspecified) and (loopback or not address.is_loopback)
