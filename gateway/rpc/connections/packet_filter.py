"""Filters of a socket's packets: programs of classic BPF (linux/filter.h) that the kernel runs."""

import ctypes
import socket
import struct
from collections.abc import Iterable
from contextlib import suppress
from ipaddress import IPv4Address, IPv6Address, ip_address
from typing import Final

_SO_ATTACH_FILTER: Final = 26
_SO_DETACH_FILTER: Final = 27
"""asm-generic/socket.h; Python's socket module has neither."""
_PROGRAM: Final = struct.Struct("@HP")
"""struct sock_fprog: number of instructions, their address."""
_INSTRUCTION: Final = struct.Struct("=HBBI")
"""struct sock_filter: code, jumps if true and if false, in instructions, and a constant."""

_LOAD_BYTE: Final = 0x30
_LOAD_WORD: Final = 0x20
_LOAD_STORED: Final = 0x60
_STORE: Final = 0x02
_SHIFT_RIGHT: Final = 0x74
_JUMP: Final = 0x05
_JUMP_IF_EQUAL: Final = 0x15
_RETURN: Final = 0x06
"""The number of bytes that are kept; 0 drops the packet."""
_ALL_BYTES: Final = 0xFFFF_FFFF
_NETWORK_HEADER: Final = 0x1_0000_0000 - 0x10_0000
"""SKF_NET_OFF, from which the IP header is addressed; a filter of TCP sees it no other way."""
_IPV4_SOURCE: Final = _NETWORK_HEADER + 12
"""RFC 791 3.1."""
_IPV6_SOURCE: Final = _NETWORK_HEADER + 8
"""RFC 8200 3."""
_HIGH, _LOW = 0, 1
"""Words of the scratch memory."""


def _instruction(code: int, constant: int, if_true: int = 0, if_false: int = 0) -> bytes:
    return _INSTRUCTION.pack(code, if_true, if_false, constant)


_DROP: Final = _instruction(_RETURN, 0)
_PASS: Final = _instruction(_RETURN, _ALL_BYTES)

DROP_ALL: Final = _DROP
"""Drops every packet."""


def drop_from(prefixes: Iterable[str]) -> bytes:
    """Returns the program that drops packets from these addresses.

    Args:
        prefixes: IPv4 addresses, and /64 prefixes of IPv6 (`gateway.access.address_prefix`).
    """
    ipv4, ipv6 = [], []
    for address in map(ip_address, prefixes):
        if isinstance(address, IPv4Address):
            ipv4.append(_if_ipv4(address))
        else:
            ipv6.append(_if_ipv6(address))
    of_ipv6 = b"".join(
        [
            _instruction(_LOAD_WORD, _IPV6_SOURCE),
            _instruction(_STORE, _HIGH),
            _instruction(_LOAD_WORD, _IPV6_SOURCE + 4),
            _instruction(_STORE, _LOW),
            *ipv6,
            _PASS,
        ]
    )
    return b"".join(
        [
            _instruction(_LOAD_BYTE, _NETWORK_HEADER),
            _instruction(_SHIFT_RIGHT, 4),
            # Conditional jumps reach 255 instructions, this one any number.
            _instruction(_JUMP_IF_EQUAL, 4, if_true=0, if_false=1),
            _instruction(_JUMP, len(of_ipv6) // _INSTRUCTION.size),
            of_ipv6,
            _instruction(_LOAD_WORD, _IPV4_SOURCE),
            *ipv4,
            _PASS,
        ]
    )


def attach(filtered: socket.socket, program: bytes) -> None:
    """Applies a program to every packet that arrives for the socket, in place of the one before.

    Raises:
        OSError: the kernel does not permit it; some do so for root alone.
    """
    instructions = ctypes.create_string_buffer(program, len(program))
    count = len(program) // _INSTRUCTION.size
    described = _PROGRAM.pack(count, ctypes.addressof(instructions))
    # First, because a socket's memory for options (net.core.optmem_max) may not be enough for two.
    with suppress(OSError):
        filtered.setsockopt(socket.SOL_SOCKET, _SO_DETACH_FILTER, 0)
    filtered.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, described)


def _if_ipv4(address: IPv4Address) -> bytes:
    return _instruction(_JUMP_IF_EQUAL, int(address), if_true=0, if_false=1) + _DROP


def _if_ipv6(prefix: IPv6Address) -> bytes:
    high, low = divmod(int(prefix) >> 64, 1 << 32)
    return b"".join(
        [
            _instruction(_LOAD_STORED, _HIGH),
            _instruction(_JUMP_IF_EQUAL, high, if_true=0, if_false=3),
            _instruction(_LOAD_STORED, _LOW),
            _instruction(_JUMP_IF_EQUAL, low, if_true=0, if_false=1),
            _DROP,
        ]
    )
