"""The examination of this machine: configuration first, then everything it names."""

from collections.abc import Iterator
from pathlib import Path

from common.errors import UserError
from common.findings import Finding, good, note, wrong
from gateway.config import GatewaySettings, SourceSettings, load_settings
from gateway.doctor.access import access_finding
from gateway.doctor.devices import device_findings
from gateway.doctor.doors import operator_door, preview_door


def examine(config: Path | None) -> Iterator[Finding]:
    """All findings, one after the other; looking at ROS takes some seconds."""
    try:
        settings = load_settings(config)
    except UserError as error:
        yield wrong("configuration", error.what, "The gateway does not start with it", error.remedy)
        return
    yield from _of(settings, config)


def _of(settings: GatewaySettings, config: Path | None) -> Iterator[Finding]:
    yield good("configuration", f"{config or 'defaults and environment'}: good, gateway '{settings.name}'")
    if settings.security.insecure:
        yield note(
            "access",
            "security.insecure: everybody who reaches the address may read and switch everything",
            "Nothing is encrypted and nobody is asked who they are",
        )
    if settings.security.credentials is not None:
        yield access_finding(settings.security)
    yield operator_door(settings.grpc.host, settings.grpc.port)
    yield preview_door(settings.preview.socket)
    yield from device_findings()
    yield from _ros(settings.sources)


def _ros(sources: tuple[SourceSettings, ...]) -> Iterator[Finding]:
    if not sources:
        yield good("ros", "no sources are configured; ROS is not used")
        return
    try:
        # Late, because this doctor must not need what it looks for.
        # The first one ends with a sentence for people where rclpy is missing.
        from gateway.ros.doctor import ros_findings  # noqa: PLC0415
    except UserError as error:
        yield wrong("ros", error.what, "Without ROS 2 no source can be read", error.remedy)
        return
    yield from ros_findings(sources)
