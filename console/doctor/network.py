"""The network path to the robot, below gRPC: its name, its TCP port, the UDP port of its stream."""

import socket
import time
from collections.abc import Iterable
from typing import Final

from common.findings import Finding, good, note, wrong
from console.doctor.srt_probe import answers_as_srt
from console.name_lookup import resolve

_WITHIN_S: Final = 2.0


def split(target: str) -> tuple[str, int]:
    """Returns host (without brackets) and port of HOST:PORT."""
    host, _, port = target.rpartition(":")
    return host.strip("[]"), int(port)


def name_finding(host: str) -> Finding:
    """Checks whether the robot's name resolves."""
    try:
        found = resolve(host, None, socket.SOCK_STREAM, _WITHIN_S)
    except OSError as error:
        return wrong(
            "name",
            f"'{host}' does not resolve: {error}",
            "Without an address the robot can't be reached",
            f"Use the robot's address instead (--target ADDRESS), or look the name up: getent hosts {host}",
        )
    addresses = sorted({str(entry[4][0]) for entry in found})
    return good("name", f"{host} is {', '.join(addresses)}")


def tcp_finding(host: str, port: int) -> Finding:
    """Checks whether something listens on the gateway's port."""
    begin_s = time.monotonic()
    try:
        with socket.create_connection((host, port), timeout=_WITHIN_S):
            took_ms = (time.monotonic() - begin_s) * 1000
            return good("tcp", f"port {port} of {host} answers after {took_ms:.0f} ms")
    except OSError as error:
        return wrong("tcp", *_why_not(error, host, port))


def _why_not(error: OSError, host: str, port: int) -> tuple[str, str, str]:
    """Returns what happened, why it matters and the remedy."""
    if isinstance(error, ConnectionRefusedError):
        return (
            f"nothing listens on port {port} of {host}",
            "The robot is up, but its gateway is not running, or listens on another address or port",
            "Type on the robot: systemctl status robot-gateway, or robot-gateway doctor",
        )
    if isinstance(error, TimeoutError):
        return (
            f"{host} does not answer on port {port} within {_WITHIN_S:g} s",
            "The robot is off, on another network, or a firewall drops the packets",
            f"Type: ping {host}",
        )
    return (
        f"{host} is unreachable: {error.strerror or error}",
        "There is no route from this computer's network to the robot's",
        "Type: ip route",
    )


def nearby_finding(nearby: Iterable[tuple[str, str]]) -> Finding | None:
    """Names the gateways that announce themselves on this network, where the requested one is not reached.

    Args:
        nearby: Name and HOST:PORT of each.
    """
    found = [f"{name} at {target}" for name, target in nearby]
    if not found:
        return None
    return note(
        "nearby",
        f"announced on this network: {', '.join(found)}",
        "One of them may be the robot, at another address; nothing announced is trusted",
        "Type: robotctl robots discover",
    )


def stream_finding(host: str, port: int) -> Finding:
    """Checks whether an SRT listener answers on the running stream's UDP port."""
    if answers_as_srt(host, port):
        return good("stream", f"the stream answers on UDP port {port} of {host}")
    return wrong(
        "stream",
        f"UDP port {port} of {host} does not answer, though the preview is running",
        "Status and commands work (TCP), but no video will arrive: a firewall on the way blocks UDP",
        f"Open UDP port {port} on the way; on the robot: sudo ss -lunp 'sport = :{port}'",
    )
