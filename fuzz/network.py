"""What a laptop takes from its network before it knows a robot: refusals of gateways, and announcements."""

import socket
from typing import Any, Final

import grpc
from zeroconf.asyncio import AsyncServiceInfo

from common.advertisement import SERVICE_TYPE
from console.client.error_table import error_from
from console.robots.discovery import question, robot_in
from console.robots.robots_file import check_name
from console.target import parse_target
from tests.support.control_characters import CONTROL_CHARACTERS

FULL_NAME: Final = 1 << 6
"""In the second byte of an announcement: its name is not completed to one of the service."""
_OBEYED: Final = frozenset(CONTROL_CHARACTERS)
_CODES: Final = tuple(grpc.StatusCode)
_LONGEST_WORD: Final = 63
_YEAR_S: Final = 365 * 86_400


def gateways_refusal(data: bytes) -> None:
    """The end of a call, in the client library: one printable line, printable details, a possible delay.

    A byte for the code, one for the length of the message, the message, and google.rpc.Status.
    """
    if len(data) < 2:
        return
    code, text, details = _CODES[data[0] % len(_CODES)], data[2 : 2 + data[1]], data[2 + data[1] :]
    failure: Any = _Failure(code, text.decode("utf-8", "surrogateescape"), details)
    error = error_from(failure, "robot:50051", 2.0)
    for each in (str(error), error.reason, *error.fields):
        assert not _OBEYED & set(each), each
    assert error.retry_after_s is None or 0 <= error.retry_after_s <= _YEAR_S


def announcement(data: bytes) -> None:
    """A name, addresses and a TXT record of mDNS, in a search: a robot of short and printable words, or none.

    A byte for the length of the name; one for the number of IPv4 addresses (two bits), that of IPv6 addresses
    (two bits) and FULL_NAME; two of the port; the name, the addresses, and the TXT record.
    """
    if len(data) < 4:
        return
    flags, port, rest = data[1], int.from_bytes(data[2:4]), data[4:]
    text, rest = rest[: data[0]].decode("utf-8", "replace"), rest[data[0] :]
    name = text if flags & FULL_NAME else f"{text}.{SERVICE_TYPE}"
    if question(SERVICE_TYPE, name) is None:
        return
    addresses = []
    for length in [4] * (flags & 3) + [16] * (flags >> 2 & 3):
        addresses.append(rest[:length].ljust(length, b"\0"))
        rest = rest[length:]
    info = AsyncServiceInfo(SERVICE_TYPE, name, port, properties=rest, addresses=addresses, interface_index=2)
    if robot := robot_in(info, loopback=False):
        for each in (robot.name, robot.contract):
            assert len(each) <= _LONGEST_WORD
            assert not _OBEYED & set(each), each
        assert parse_target(robot.target) == robot.target
        check_name(robot.nickname)
        _must_be_another_machines(robot.target)


class _Failure:
    """A failed call, as both APIs of gRPC raise it."""

    def __init__(self, code: grpc.StatusCode, text: str, details: bytes) -> None:
        self._code, self._text = code, text
        self._metadata = (("grpc-status-details-bin", details),)

    def code(self) -> grpc.StatusCode:
        return self._code

    def details(self) -> str:
        return self._text

    def trailing_metadata(self) -> tuple[tuple[str, bytes], ...]:
        return self._metadata


def _must_be_another_machines(target: str) -> None:
    """Judged by the bytes of the address, without the library that the search uses."""
    host = target.rpartition(":")[0].strip("[]").partition("%")[0]
    packed = socket.inet_pton(socket.AF_INET6 if ":" in host else socket.AF_INET, host)
    mapped = packed[:12] == bytes(10) + b"\xff\xff"
    address = packed[12:] if mapped else packed
    assert any(address), target
    assert address[0] not in ((127, *range(224, 240)) if len(address) == 4 else (255,)), target
    assert address != bytes(15) + b"\1", target
