"""The examination, from the network inwards; it stops at the first fault that blocks the rest."""

import time
from collections.abc import Callable, Iterable, Iterator
from typing import Final

from common.findings import Finding, Verdict, good, wrong
from common.version import project_version
from console.client import Credentials, GatewayClient, PreviewState, SystemStatus, errors
from console.doctor import network, robot

_ON_THE_WAY: Final = ("name", "tcp", "grpc")
"""The checks of the way to the gateway."""


def examine(
    target: str,
    credentials: Credentials | None = None,
    wall_clock: Callable[[], float] = time.time,
    nearby: Callable[[], Iterable[tuple[str, str]]] = tuple,
) -> Iterator[Finding]:
    """Yields the findings as they are made.

    Args:
        target: HOST:PORT.
        credentials: Token and certificates for the robot.
        wall_clock: This computer's wall clock, in seconds since 1970.
        nearby: Returns name and HOST:PORT of the gateways that announce themselves; called where none is
            reached.
    """
    findings = []
    for finding in _examine(target, credentials, wall_clock):
        findings.append(finding)
        yield finding
    if not reached(findings) and (announced := network.nearby_finding(nearby())):
        yield announced


def _examine(
    target: str, credentials: Credentials | None, wall_clock: Callable[[], float]
) -> Iterator[Finding]:
    host, port = network.split(target)
    name = network.name_finding(host)
    yield name
    if name.verdict is Verdict.WRONG:
        return
    tcp = network.tcp_finding(host, port)
    yield tcp
    if tcp.verdict is Verdict.WRONG:
        return
    with GatewayClient(target, credentials=credentials) as client:
        try:
            status = client.status()
        except (errors.NotAllowed, errors.NotTrusted) as error:
            yield wrong("access", error.what, "The gateway serves authenticated clients only", error.remedy)
            return
        except errors.GatewayError as error:
            yield wrong("grpc", error.what, "Something listens there, but it is not a gateway", error.remedy)
            return
        yield good("grpc", f"the gateway '{status.gateway_name}' answers")
        yield from _about_the_gateway(client, wall_clock)
    yield from _about_the_robot(status)


def reached(findings: Iterable[Finding]) -> bool:
    """Returns whether the gateway answered in an examination with these findings."""
    return not any(each.verdict is Verdict.WRONG and each.check in _ON_THE_WAY for each in findings)


def _about_the_gateway(client: GatewayClient, wall_clock: Callable[[], float]) -> Iterator[Finding]:
    begin_s, asked_at_s = time.monotonic(), wall_clock()
    try:
        info = client.info()
    except errors.Unsupported:
        yield robot.old_gateway_finding()
        return
    half_s = (time.monotonic() - begin_s) / 2
    yield robot.version_finding(info.gateway_version, project_version())
    yield robot.clock_finding(info.wall_clock_unix_ms / 1000, asked_at_s + half_s, half_s)
    yield robot.calls_finding(info)


def _about_the_robot(status: SystemStatus) -> Iterator[Finding]:
    yield robot.health_finding(status)
    yield from robot.fault_findings(status)
    yield from robot.source_findings(status)
    yield from robot.encoder_findings(status)
    yield from robot.driving_findings(status)
    yield from robot.cloud_findings(status)
    endpoint = status.preview.endpoint
    if status.preview.state is PreviewState.RUNNING and endpoint:
        yield network.stream_finding(endpoint.host, endpoint.port)
    access = robot.access_finding(status)
    if access:
        yield access
