"""Findings from the robot's own status and info."""

from collections.abc import Iterator
from typing import Final

from common.findings import Finding, good, note, wrong
from console.client import GatewayInfo, PreviewState, SystemStatus
from console.client.drive_reasons import SENTENCES, stopped_by
from console.client.results import (
    CloudState,
    DriveInhibit,
    FaultSeverity,
    HealthState,
    SourceState,
    Teleop,
    TeleopState,
)

LARGEST_SKEW_S: Final = 1.0
_FALLBACK: Final = "preview.fallback"
"""Another encoder than the first choice works as well, and on a machine without hardware it always is one."""
_OF_THE_FLEET: Final = "cloud."
"""What the ids of the fleet's faults begin with."""
_OF_DRIVING: Final = "drive."
"""What the ids of the faults of driving begin with."""


def version_finding(gateway_version: str, own_version: str) -> Finding:
    """Checks whether both programs are of the same version."""
    if _series(gateway_version) == _series(own_version):
        return good("version", f"the gateway is {gateway_version}, this program {own_version}")
    return note(
        "version",
        f"the gateway is {gateway_version or 'of an unknown version'}, this program {own_version}",
        "They work together, but the older one lacks features of the newer one",
        "Update the older one",
    )


def old_gateway_finding() -> Finding:
    """Reports a gateway without GetGatewayInfo."""
    return note(
        "version",
        "the gateway is older than this program: it does not report its clock, calls and configuration",
        "They work together, but some checks are not possible",
        "Update the gateway",
    )


def clock_finding(robot_unix_s: float, own_unix_s: float, uncertainty_s: float) -> Finding:
    """Checks whether both wall clocks agree.

    Args:
        robot_unix_s: The robot's clock, in seconds since 1970.
        own_unix_s: This computer's clock in the middle of the call.
        uncertainty_s: Half of the round trip.
    """
    skew_s = robot_unix_s - own_unix_s
    about = f"{abs(skew_s):.1f} s (± {uncertainty_s:.1f} s)"
    if abs(skew_s) <= LARGEST_SKEW_S + uncertainty_s:
        return good("clock", f"both clocks agree within {about}")
    return wrong(
        "clock",
        f"the robot's clock is {about} {'ahead of' if skew_s > 0 else 'behind'} this computer's",
        "Logs and recordings of both can't be aligned, and certificates may be refused. "
        "The ages in the status do not depend on it",
        "Type on both: timedatectl; then: sudo timedatectl set-ntp true",
    )


def health_finding(status: SystemStatus) -> Finding:
    """Reports the robot's own verdict; as a note where an active fault is the reason."""
    health = status.health
    if health.ready and health.state is HealthState.OK:
        return good("health", health.summary)
    why = "A part of the robot does not work" if health.ready else "The robot can't work"
    if any(fault.active and fault.severity is FaultSeverity.ERROR for fault in status.faults):
        return note("health", health.summary, why, "See the faults below")
    return wrong("health", health.summary, why, "See the findings below")


def fault_findings(status: SystemStatus) -> Iterator[Finding]:
    """Yields the gateway's active faults."""
    for fault in status.faults:
        if not fault.active:
            continue
        check = f"fault.{fault.id}"
        if fault.severity is FaultSeverity.INFO or fault.id == _FALLBACK:
            yield note(check, fault.message, remedy=fault.remedy)
        else:
            yield wrong(check, fault.message, f"{fault.severity.value} of {fault.component}", fault.remedy)


_WHY: Final = {
    SourceState.WAITING: ("Nothing on the robot publishes it", "Start the program that publishes it"),
    SourceState.SILENT: ("It has a publisher that sends nothing", "Check the program that publishes it"),
    SourceState.STALE: ("Its publisher has stopped sending", "Check the program that publishes it"),
    SourceState.QOS_MISMATCH: (
        "Publisher and gateway have incompatible QoS: nothing can be received",
        "Change reliability or durability of this source in the gateway's configuration",
    ),
    SourceState.WRONG_TYPE: (
        "Publisher and gateway use different types: nothing can be received",
        "Correct the type of this source in the gateway's configuration",
    ),
    SourceState.TYPE_MISSING: (
        "The gateway lacks the message type",
        "Type on the robot: robot-gateway doctor",
    ),
    SourceState.FIELD_MISSING: (
        "The message type lacks the field that the gateway is configured for",
        "Type on the robot: robot-gateway doctor",
    ),
    SourceState.UNDECODABLE: (
        "The robot's message type has other fields than the gateway's",
        "Install the robot's version of this message package beside the gateway",
    ),
    SourceState.UNKNOWN: ("The gateway is newer than this program", "Update this program"),
}


def source_findings(status: SystemStatus) -> Iterator[Finding]:
    """Yields one finding per source, except those that a fault covers."""
    faulted = {fault.id.rpartition(".")[0] for fault in status.faults if fault.active}
    for source in status.sources:
        check = f"source.{source.name}"
        if source.state is SourceState.RECEIVING:
            yield good(check, f"received, {source.age_ms} ms old")
        elif source.name not in faulted:
            yield note(check, source.detail or source.state.value, *_WHY[source.state])


def encoder_findings(status: SystemStatus) -> Iterator[Finding]:
    """Yields a finding on the encoder, which only a preview that runs or has failed proves."""
    preview = status.preview
    if preview.state is PreviewState.RUNNING and preview.encoder:
        kind = "hardware" if preview.encoder.hardware else "the robot's processor"
        yield good("encoder", f"{preview.encoder.name} ({kind}) delivers frames")
    if preview.state is PreviewState.FAULTED:
        yield wrong(
            "encoder",
            f"no video: {preview.last_error}",
            "The preview is enabled and does not work",
            "Type on the robot: robot-preview encoders",
        )


_INHIBITED: Final = {
    DriveInhibit.BASE_ABSENT: "Type on the robot: robot-drive doctor",
    DriveInhibit.OUTRANKED: "Type on the robot: robot-drive doctor; it names what else drives the base",
    DriveInhibit.ROBOT_STOP: "Release the robot's own stop",
    DriveInhibit.DRIVE_LOST: "Start or restart robot-drive on the robot",
}
"""What to do where the driver's own program can't help."""
_OF_THE_LAST_DRIVER: Final = frozenset({DriveInhibit.ACCESS_ENDED})
"""What stays until the next session, and does not keep that from beginning."""


def driving_findings(status: SystemStatus) -> Iterator[Finding]:
    """Yields what keeps the robot from being driven, and what stops its base; nothing if it is not set up."""
    teleop = status.teleop
    if teleop.state is TeleopState.UNKNOWN:
        return
    if teleop.stop:
        what = f"the robot is stopped {stopped_by(teleop.stop)}"
        remedy = f"When it may move again, type: robotctl reset-stop {teleop.stop.stop_id}"
        yield note("driving", what, "Nothing moves until that is reset", remedy)
    else:
        yield from _obstacles(teleop)
        if _can_be_driven(status):
            who = f"{teleop.holder} drives" if teleop.holder else "no one drives"
            yield good("driving", f"the robot can be driven; {who}")
    yield _base_timeout(teleop.base_timeout_ms)


def _obstacles(teleop: Teleop) -> Iterator[Finding]:
    for inhibit in teleop.inhibits:
        if inhibit in _INHIBITED:
            yield note(
                "driving", SENTENCES[inhibit], "The robot does not move for a driver", _INHIBITED[inhibit]
            )
    if not teleop.enabled and DriveInhibit.DRIVE_LOST not in teleop.inhibits:
        yield note("driving", "driving is disabled", "No one can drive", "Type: robotctl drive --enable")


def _can_be_driven(status: SystemStatus) -> bool:
    """Returns whether nothing is known that keeps the robot from being driven, its faults included."""
    faulted = any(fault.active and fault.id.startswith(_OF_DRIVING) for fault in status.faults)
    inhibits = set(status.teleop.inhibits) - _OF_THE_LAST_DRIVER
    return status.teleop.enabled and not inhibits and not faulted


def _base_timeout(timeout_ms: int | None) -> Finding:
    if timeout_ms is not None:
        return good("driving.base", f"the base stops by itself after {timeout_ms} ms without commands")
    return note(
        "driving.base",
        "what stops the base if the robot's computer freezes is not known",
        "Only the base's own timeout does, and no one has said that it has one",
        "Measure it on the robot: robot-drive doctor --pulse; then set base_timeout_ms of robot-drive",
    )


def cloud_findings(status: SystemStatus) -> Iterator[Finding]:
    """Yields what keeps the robot from its fleet, as far as no fault covers it; nothing without a fleet."""
    cloud = status.cloud
    if cloud is None:
        return
    named = f"{cloud.robot} in the fleet {cloud.fleet}"
    if cloud.state is CloudState.CONNECTED:
        yield good("fleet", f"connected to its hub as {named}")
    elif not any(fault.active and fault.id.startswith(_OF_THE_FLEET) for fault in status.faults):
        yield note(
            "fleet",
            f"not connected to its hub: {cloud.last_error or cloud.state.value}",
            f"Events wait on the robot ({cloud.outbox_events}), and recordings are not copied",
            "Check the robot's network; type on the robot: robot-bridge doctor",
        )
    if cloud.uploads_waiting and cloud.uploads_paused:
        what = f"{cloud.uploads_waiting} recordings wait to be copied: {cloud.uploads_paused}"
        yield note("fleet.uploads", what, "They are on the robot alone")
    if cloud.uploads_left_out:
        yield note(
            "fleet.queue",
            f"{cloud.uploads_left_out} recordings are to be copied and find no place in the full queue",
            "They wait for one; the robot may delete them before, the oldest first, when its disk is full",
            "Let it upload more (uploads of the robot's bridge.yaml), or export them: robotctl record list",
        )


def access_finding(status: SystemStatus) -> Finding | None:
    """Reports a gateway without authentication."""
    if not status.insecure:
        return None
    return note(
        "access",
        "the gateway serves any computer that reaches it, unencrypted",
        "Any computer on that network can read the status and switch the preview",
        "Set security.insecure to false in the gateway's configuration, and use a tunnel",
    )


def calls_finding(info: GatewayInfo) -> Finding:
    """Checks for calls that ended with an internal error of the gateway."""
    failed = sum(counts.failed for counts in info.methods)
    if failed == 0:
        return good("calls", f"{info.gateway.requests_served or 0} calls answered, none failed")
    return wrong(
        "calls",
        f"{failed} calls ended with an internal error of the gateway",
        "That is a defect of the gateway",
        "Search its log for 'failed', and report it",
    )


def _series(version: str) -> list[str]:
    return version.split(".")[:2]
