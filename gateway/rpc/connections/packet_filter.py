"""Filters of a socket's packets: programs of classic BPF (linux/filter.h) that the kernel runs."""

import ctypes
import socket
import struct
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
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
_JUMP_IF_SET: Final = 0x45
_AND: Final = 0x54
_RETURN: Final = 0x06
"""The number of bytes that are kept; 0 drops the packet."""
_ALL_BYTES: Final = 0xFFFF_FFFF
_NETWORK_HEADER: Final = 0x1_0000_0000 - 0x10_0000
"""SKF_NET_OFF, from which the IP header is addressed; a filter of TCP sees it no other way."""
_IPV4_SOURCE: Final = _NETWORK_HEADER + 12
"""RFC 791 3.1."""
_IPV6_SOURCE: Final = _NETWORK_HEADER + 8
"""RFC 8200 3."""
_RANDOM: Final = 0x1_0000_0000 - 0x1000 + 56
"""SKF_AD_OFF and SKF_AD_RANDOM: 32 random bits, since 3.15."""
_TCP_FLAGS: Final = 13
"""RFC 9293 3.1; what is not addressed otherwise begins with the TCP header."""
_SYN: Final = 0x02
_HIGH, _LOW = 0, 1
"""Words of the scratch memory."""


def _instruction(code: int, constant: int, if_true: int = 0, if_false: int = 0) -> bytes:
    return _INSTRUCTION.pack(code, if_true, if_false, constant)


_DROP: Final = _instruction(_RETURN, 0)
_PASS: Final = _instruction(_RETURN, _ALL_BYTES)

DROP_ALL: Final = _DROP
"""Drops every packet."""


@dataclass(frozen=True, slots=True)
class ConnectPolicy:
    """Whose attempts to connect reach the listening socket.

    All addresses are prefixes (`gateway.access.address_prefix`).

    Attributes:
        blocked: addresses that may not connect.
        one_in: of how many attempts of all others one is let through, by chance; a power of two.
        spared: addresses to which `one_in` does not apply.
    """

    blocked: frozenset[str] = frozenset()
    one_in: int = 1
    spared: frozenset[str] = frozenset()


def program_of(policy: ConnectPolicy) -> bytes:
    """Returns the program that drops the attempts to connect that the policy does not let through."""
    spared_ipv4, spared_ipv6 = _comparisons(policy.spared, _PASS)
    blocked_ipv4, blocked_ipv6 = _comparisons(policy.blocked, _DROP)
    rest = _one_in(policy.one_in)
    of_ipv6 = b"".join(
        [
            _instruction(_LOAD_WORD, _IPV6_SOURCE),
            _instruction(_STORE, _HIGH),
            _instruction(_LOAD_WORD, _IPV6_SOURCE + 4),
            _instruction(_STORE, _LOW),
            *spared_ipv6,
            *blocked_ipv6,
            *rest,
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
            *spared_ipv4,
            *blocked_ipv4,
            *rest,
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


def _comparisons(prefixes: Iterable[str], verdict: bytes) -> tuple[list[bytes], list[bytes]]:
    """Returns instructions that end with this verdict for packets from one of these addresses, by family."""
    ipv4, ipv6 = [], []
    for address in map(ip_address, sorted(prefixes)):
        if isinstance(address, IPv4Address):
            ipv4.append(_if_ipv4(address, verdict))
        else:
            ipv6.append(_if_ipv6(address, verdict))
    return ipv4, ipv6


def _one_in(count: int) -> list[bytes]:
    """Returns instructions that let one of so many attempts to connect through, and every other packet.

    Once an attempt was let through, the packets that complete the connection are, too.
    """
    if count == 1:
        return [_PASS]
    return [
        _instruction(_LOAD_BYTE, _TCP_FLAGS),
        _instruction(_JUMP_IF_SET, _SYN, if_true=1, if_false=0),
        _PASS,
        _instruction(_LOAD_WORD, _RANDOM),
        _instruction(_AND, count - 1),
        _instruction(_JUMP_IF_EQUAL, 0, if_true=0, if_false=1),
        _PASS,
        _DROP,
    ]


def _if_ipv4(address: IPv4Address, verdict: bytes) -> bytes:
    return _instruction(_JUMP_IF_EQUAL, int(address), if_true=0, if_false=1) + verdict


def _if_ipv6(prefix: IPv6Address, verdict: bytes) -> bytes:
    high, low = divmod(int(prefix) >> 64, 1 << 32)
    return b"".join(
        [
            _instruction(_LOAD_STORED, _HIGH),
            _instruction(_JUMP_IF_EQUAL, high, if_true=0, if_false=3),
            _instruction(_LOAD_STORED, _LOW),
            _instruction(_JUMP_IF_EQUAL, low, if_true=0, if_false=1),
            verdict,
        ]
    )
