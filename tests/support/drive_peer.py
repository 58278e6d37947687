"""The gateway's end of the drive program's socket, as a process that can be killed and frozen.

`python -m tests.support.drive_peer SOCKET INSTANTS`: greets as the gateway, enables driving, and sends what a
driver's client sends, 50 times a second. Each line of standard input is a JSON object:
{"lease": NAME}, {"held": true, "vx": 0.1}, {"silent": true}, {"picture_frozen": true}, {"echo_frozen": true},
{"stop": BY}, {"reset": ID}, {"end": WHY}, {"enabled": false}; the rest stays as it is. INSTANTS is a
file with the instants that the tests judge by (`Instants`).
"""

import json
import mmap
import os
import select
import socket
import struct
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from omniseer.drive.v1 import drive_pb2 as pb
from tests.support.waiting import wait_until

_PERIOD_NS: Final = 20_000_000
_VALID_NS: Final = 250_000_000
_PICTURE_EVERY_NS: Final = 250_000_000
_PICTURE_AGE_NS: Final = 60_000_000
_LAYOUT: Final = struct.Struct("<4Q")


class Instants:
    """Instants of CLOCK_MONOTONIC in a file that two processes map.

    Args:
        path: of the file; created if missing.
    """

    def __init__(self, path: Path) -> None:
        with path.open("a+b") as file:
            file.truncate(_LAYOUT.size)
            self._map = mmap.mmap(file.fileno(), _LAYOUT.size)

    def close(self) -> None:
        """Unmaps the file."""
        self._map.close()

    @staticmethod
    def held_ns(path: Path) -> list[int]:
        """Returns when each command that was held was sent, from the file beside."""
        content = path.with_suffix(".held").read_bytes()
        return [ns for (ns,) in struct.iter_unpack("<Q", content[: len(content) // 8 * 8])]

    def write(self, *, command_ns: int, edge_ns: int, picture_ns: int, echo_ns: int) -> None:
        """Writes all four."""
        _LAYOUT.pack_into(self._map, 0, command_ns, edge_ns, picture_ns, echo_ns)

    @property
    def command_ns(self) -> int:
        """When the newest command was sent."""
        return self._read()[0]

    @property
    def edge_ns(self) -> int:
        """When the first command with the present `held`, or the newest stop, was sent."""
        return self._read()[1]

    @property
    def picture_ns(self) -> int:
        """Capture of the newest picture that a command has named."""
        return self._read()[2]

    @property
    def echo_ns(self) -> int:
        """The newest instant that a command has echoed."""
        return self._read()[3]

    def _read(self) -> tuple[int, int, int, int]:
        return _LAYOUT.unpack_from(self._map)


@dataclass
class _Peer:
    link: socket.socket
    instants: Instants
    held_log: Any
    lease: str = ""
    leases: int = 0
    held: bool = False
    vx: float = 0.1
    silent: bool = False
    picture_frozen: bool = False
    echo_frozen: bool = False
    sequence: int = 0
    command_ns: int = 0
    edge_ns: int = 0
    picture_ns: int = 0
    echo_ns: int = 0
    received_ns: int = 0
    pictures_ns: int = 0
    enabled: dict[str, Any] = field(default_factory=dict)

    def obey(self, line: dict[str, Any]) -> None:
        """Does what a line of standard input says."""
        edge = line.get("held", self.held) != self.held
        for name in ("held", "vx", "silent", "picture_frozen", "echo_frozen"):
            setattr(self, name, line.get(name, getattr(self, name)))
        if holder := line.get("lease"):
            self.leases += 1
            self.lease = f"{holder}-{self.leases}"
            grant = pb.GrantLease(session_id=self.lease, holder=holder, streaming=True)
            self.send(pb.ToDrive(grant=grant))
        if "stop" in line:
            self.edge_ns = time.monotonic_ns()
            self.send(pb.ToDrive(stop=pb.Stop(by=line["stop"])))
        if "reset" in line:
            self.send(pb.ToDrive(reset=pb.Reset(stop_id=line["reset"])))
        if "end" in line:
            why = pb.LeaseEnd.Value(f"LEASE_END_{line['end']}")
            self.send(pb.ToDrive(end=pb.EndLease(session_id=self.lease, why=why)))
        if "enabled" in line:
            self.send(pb.ToDrive(desired=pb.DesiredState(revision=2, enabled=line["enabled"])))
        if edge:
            self.edge_ns = time.monotonic_ns()
            self.command()

    def command(self) -> None:
        """Sends a command, unless silent."""
        now_ns = time.monotonic_ns()
        if self.lease and not self.silent:
            if not self.picture_frozen:
                self.picture_ns = now_ns - _PICTURE_AGE_NS
            if not self.echo_frozen:
                self.echo_ns = self.received_ns
            self.sequence += 1
            command = pb.Command(
                session_id=self.lease,
                sequence=self.sequence,
                held=self.held,
                vx_mps=self.vx if self.held else 0.0,
                valid_until_ns=now_ns + _VALID_NS,
                echo_ns=self.echo_ns,
                picture_ns=self.picture_ns,
            )
            if self.send(pb.ToDrive(command=command)):
                self.command_ns = now_ns
                if self.held:
                    self.held_log.write(struct.pack("<Q", now_ns))
        if now_ns - self.pictures_ns >= _PICTURE_EVERY_NS:
            self.pictures_ns = now_ns
            self.send(pb.ToDrive(picture=pb.Picture(running=True, newest_capture_ns=now_ns - 10_000_000)))
        self.instants.write(
            command_ns=self.command_ns,
            edge_ns=self.edge_ns,
            picture_ns=self.picture_ns,
            echo_ns=self.echo_ns,
        )

    def send(self, message: pb.ToDrive) -> bool:
        """Sends without waiting; returns whether there was room."""
        try:
            self.link.send(message.SerializeToString(), socket.MSG_DONTWAIT)
        except BlockingIOError:
            return False
        return True

    def receive(self) -> None:
        """Takes the newest of what the drive program says."""
        packet = self.link.recv(65536)
        if not packet:
            raise SystemExit("the drive program has gone")
        self.received_ns = pb.FromDrive.FromString(packet).actual.monotonic_ns or self.received_ns


def connected(path: str) -> socket.socket | None:
    """A connection to the drive program; None while nothing listens."""
    link = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        link.connect(path)
    except OSError:
        link.close()
        return None
    return link


def main() -> None:
    # A worker that was lost is followed by another one, which does not listen at once.
    link = wait_until(lambda: connected(sys.argv[1]), "a worker listens")
    path = Path(sys.argv[2])
    held_log = path.with_suffix(".held").open("ab", buffering=0)
    peer = _Peer(link, Instants(path), held_log)
    peer.send(pb.ToDrive(hello=pb.Hello(gateway=True)))
    peer.send(pb.ToDrive(desired=pb.DesiredState(revision=1, enabled=True)))
    print("ready", flush=True)
    due_ns, rest = time.monotonic_ns(), b""
    while True:
        wait_s = max(0.0, (due_ns - time.monotonic_ns()) / 1e9)
        ready, _, _ = select.select([link, sys.stdin], [], [], wait_s)
        if link in ready:
            peer.receive()
        if sys.stdin in ready:
            # Not by its buffer, in which select(2) sees nothing of further lines.
            read = os.read(sys.stdin.fileno(), 65536)
            if not read:
                return
            *lines, rest = (rest + read).split(b"\n")
            for line in lines:
                peer.obey(json.loads(line))
        if time.monotonic_ns() >= due_ns:
            peer.command()
            due_ns = max(due_ns + _PERIOD_NS, time.monotonic_ns())


if __name__ == "__main__":
    main()
