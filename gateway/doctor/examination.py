"""Runs all checks: the configuration first, then everything that it refers to."""

import time
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from common.errors import UserError
from common.findings import Finding, Verdict, good, note, wrong
from gateway.access.command import credentials_command
from gateway.access.credential import Validity
from gateway.access.directory import CredentialDirectory
from gateway.access.reloader import TlsFiles, load_access
from gateway.config import GatewaySettings, SourceSettings, load_settings
from gateway.doctor.devices import device_findings
from gateway.doctor.endpoints import BRIDGE, DRIVE, PREVIEW, RECORDER, operator_endpoint, service_endpoint
from gateway.doctor.video import video_finding


def examine(config: Path | None) -> Iterator[Finding]:
    """Yields all findings; the checks of ROS take some seconds."""
    try:
        settings = load_settings(config)
    except UserError as error:
        yield wrong("configuration", error.what, "The gateway does not start with it", error.remedy)
        return
    yield good("configuration", f"{config or 'defaults and environment'}: valid, gateway '{settings.name}'")
    if settings.security.insecure:
        yield note(
            "access",
            "security.insecure: everyone who can reach the gateway may read and control everything",
            "Nothing is encrypted, and callers are not authenticated",
        )
    if access_files := settings.security.access_files():
        yield _access(*access_files)
    yield operator_endpoint(settings.grpc.host, settings.grpc.port)
    preview = service_endpoint(PREVIEW, settings.preview.socket)
    yield preview
    if preview.verdict is Verdict.GOOD:
        yield video_finding(settings)
    if settings.teleop.socket:
        yield service_endpoint(DRIVE, settings.teleop.socket)
    if settings.recording.socket:
        yield service_endpoint(RECORDER, settings.recording.socket)
    if settings.bridge.socket:
        yield service_endpoint(BRIDGE, settings.bridge.socket)
    yield from _hub(settings)
    yield from device_findings()
    yield from _ros(settings.sources)


def _hub(settings: GatewaySettings) -> Iterator[Finding]:
    """Yields what is wrong with the requests that the fleet's hub is allowed; says which there are."""
    allowed = [each.value for each in settings.bridge.allowed_requests]
    lacking = [
        key
        for key, socket in (
            ("bridge.socket", settings.bridge.socket),
            ("recording.socket", settings.recording.socket),
        )
        if socket is None
    ]
    if allowed and lacking:
        yield wrong(
            "bridge.requests",
            f"bridge.allowed_requests allows {', '.join(allowed)}, but {' and '.join(lacking)} is not set",
            "The hub's requests can't be carried out",
            f"Set {' and '.join(lacking)}, or leave bridge.allowed_requests out",
        )
    elif settings.bridge.socket:
        yield good("bridge.requests", f"the fleet's hub may request: {', '.join(allowed) or 'nothing'}")


def _access(directory: CredentialDirectory, tls: TlsFiles | None) -> Finding:
    try:
        loaded = load_access(directory, tls)
    except UserError as error:
        return wrong("access", error.what, "The gateway does not start with it", error.remedy)
    now_s = time.time()
    valid = sum(each.validity(now_s) is Validity.VALID for each in loaded.store.credentials.values())
    if not valid:
        return note(
            "access",
            f"no credential in {directory.path} is valid",
            "Every caller must present one",
            f"Type: {credentials_command('add NAME --role operator', directory.path)}",
        )
    ends = [datetime.fromtimestamp(each, UTC).date().isoformat() for each in loaded.ends_s.values()]
    until = f"; the certificate is valid until {min(ends)}" if ends else ""
    return good("access", f"valid credentials: {valid}{until}")


def _ros(sources: tuple[SourceSettings, ...]) -> Iterator[Finding]:
    if not sources:
        yield good("ros", "no sources are configured; ROS is not used")
        return
    try:
        # Imported late, because the doctor must run without rclpy; the import then raises a UserError.
        from gateway.ros.doctor import ros_findings  # noqa: PLC0415
    except UserError as error:
        yield wrong("ros", error.what, "Without ROS 2 no source can be read", error.remedy)
        return
    yield from ros_findings(sources)
