"""A bad link for TCP on this machine: packets of real connections are delayed and lost, each way by itself.

A TUN device (Linux, networking/tuntap.rst) has a subnet of its own. What is sent to its far address comes out
of the device; with source and destination exchanged it goes back in, as a connection from that far address to
the near one. The sum of the addresses stays the same, and so do the checksums (RFC 9293 3.1). Both ends are
the kernel's own TCP: retransmission, backoff and head-of-line blocking are real.
"""

import fcntl
import os
import select
import shutil
import socket
import struct
import subprocess
import threading
import time
from types import TracebackType
from typing import Final, Self

import pytest

from tests.support.udp_link import Direction, Impairment, Line, next_arrival_in_s

needs_tun = pytest.mark.skipif(
    os.geteuid() != 0 or shutil.which("ip") is None, reason="a network device needs root and ip"
)

_CLONE: Final = "/dev/net/tun"
_TUNSETIFF: Final = 0x400454CA
_TUN_WITHOUT_HEADER: Final = 0x0001 | 0x1000
"""IFF_TUN, IFF_NO_PI of linux/if_tun.h."""
_REQUEST: Final = struct.Struct("16sH")
_PREFIX: Final = "lossy"
_LONGEST_PACKET: Final = 65_536
_TCP: Final = 6
"""Protocol number, in byte 9 of an IPv4 header (RFC 791 3.1)."""


class TcpLink:
    """A link to a TCP port of this machine until its block ends; the server listens on all addresses.

    Args:
        to_port: of the server.
        up: what becomes of packets to the server; kept, so that it may be changed.
        down: the same of packets from it.
        seed: of the random losses.

    Attributes:
        host: by which the server is reached over the link.
        target: the same with the port.
    """

    def __init__(
        self, to_port: int, up: Impairment | None = None, down: Impairment | None = None, seed: int = 1
    ) -> None:
        self.up, self.down = up or Impairment(), down or Impairment()
        self._up_line = Line[bytes](Direction(self.up, seed))
        self._down_line = Line[bytes](Direction(self.down, seed + 1))
        self._to_port = to_port
        self._device = os.open(_CLONE, os.O_RDWR)
        # The kernel numbers the device, so that links at the same time differ in name and subnet.
        request = _REQUEST.pack(f"{_PREFIX}%d".encode(), _TUN_WITHOUT_HEADER)
        self._name = fcntl.ioctl(self._device, _TUNSETIFF, request)[:16].rstrip(b"\0").decode()
        # 198.18.0.0/15 is for tests of networks (RFC 2544 C.2.2).
        number = int(self._name.removeprefix(_PREFIX))
        self._subnet = f"198.18.{number % 256}"
        self.host = f"{self._subnet}.2"
        self.target = f"{self.host}:{to_port}"
        self._stop_here, self._stop_there = socket.socketpair()
        self._thread = threading.Thread(target=self._run, name="TCP link")

    def __enter__(self) -> Self:
        for words in (
            ("address", "add", f"{self._subnet}.1/24", "dev", self._name),
            ("link", "set", self._name, "up"),
        ):
            subprocess.run(["ip", *words], check=True, capture_output=True, text=True)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop_there.send(b"x")
        self._thread.join(10)
        os.close(self._device)  # and with it the device
        self._stop_here.close()
        self._stop_there.close()

    def impair(self, *, loss: float = 0.0, delay_s: float = 0.0) -> None:
        """Changes both directions."""
        for each in (self.up, self.down):
            each.loss, each.delay_s = loss, delay_s

    def cut(self) -> None:
        """Loses everything from now on."""
        self.impair(loss=1.0)

    def _run(self) -> None:
        lines, stop = (self._up_line, self._down_line), self._stop_here.fileno()
        while True:
            ready, _, _ = select.select([self._device, stop], [], [], next_arrival_in_s(*lines))
            if stop in ready:
                return
            if self._device in ready:
                self._take(os.read(self._device, _LONGEST_PACKET))
            for line in lines:
                for packet in line.arrived(time.monotonic()):
                    os.write(self._device, packet)

    def _take(self, packet: bytes) -> None:
        if packet[0] >> 4 != 4 or packet[9] != _TCP:
            return
        header = (packet[0] & 0x0F) * 4
        to_port = int.from_bytes(packet[header + 2 : header + 4])
        line = self._up_line if to_port == self._to_port else self._down_line
        line.send(packet, packet[:12] + packet[16:20] + packet[12:16] + packet[20:])
