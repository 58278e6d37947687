"""What the robot says of itself, turned into findings."""

from collections.abc import Iterator
from typing import Final

from common.findings import Finding, good, note, wrong
from console.client import GatewayInfo, PreviewState, SystemStatus
from console.client.results import FaultSeverity, SourceState

LARGEST_SKEW_S: Final = 1.0


def version_finding(gateway_version: str, own_version: str) -> Finding:
    """Whether both sides are of the same version."""
    if _series(gateway_version) == _series(own_version):
        return good("version", f"the gateway is {gateway_version}, this program {own_version}")
    return note(
        "version",
        f"the gateway is {gateway_version or 'of an unknown version'}, this program {own_version}",
        "They understand each other, but the older one lacks what the newer one has",
        "Update the older one",
    )


def old_gateway_finding() -> Finding:
    """The gateway does not know the method that tells about itself."""
    return note(
        "version",
        "the gateway is older than this program: it can't tell its clock, its calls and its configuration",
        "They understand each other, but some checks are not possible",
        "Update the gateway",
    )


def clock_finding(robot_unix_s: float, own_unix_s: float, uncertainty_s: float) -> Finding:
    """Whether both calendar clocks agree.

    Args:
        robot_unix_s: what the robot's clock showed.
        own_unix_s: what ours showed in the middle of the call.
        uncertainty_s: half of the time the call took.
    """
    skew_s = robot_unix_s - own_unix_s
    about = f"{abs(skew_s):.1f} s (± {uncertainty_s:.1f} s)"
    if abs(skew_s) <= LARGEST_SKEW_S + uncertainty_s:
        return good("clock", f"both clocks agree within {about}")
    return wrong(
        "clock",
        f"the robot's clock is {about} {'ahead of' if skew_s > 0 else 'behind'} this computer's",
        "Logs and recordings of both sides don't fit together, and certificates may be refused. "
        "No age in the status depends on it",
        "Type on both: timedatectl; then: sudo timedatectl set-ntp true",
    )


def health_finding(status: SystemStatus) -> Finding:
    """The robot's own verdict; no trouble of its own where a fault tells of the same."""
    health = status.health
    if health.ready:
        return good("health", health.summary)
    if any(fault.active and fault.severity is FaultSeverity.ERROR for fault in status.faults):
        return note(
            "health", health.summary, "The robot can't take work", "The faults below say what is missing"
        )
    return wrong(
        "health", health.summary, "The robot can't take work", "The findings below say what is missing"
    )


def fault_findings(status: SystemStatus) -> Iterator[Finding]:
    """Everything the gateway itself calls wrong."""
    for fault in status.faults:
        if not fault.active:
            continue
        check = f"fault.{fault.id}"
        if fault.severity is FaultSeverity.INFO:
            yield note(check, fault.message, remedy=fault.remedy)
        else:
            yield wrong(check, fault.message, f"{fault.severity.value} of {fault.component}", fault.remedy)


_WHY: Final = {
    SourceState.WAITING: ("Nobody on the robot offers it", "Start the program that makes it"),
    SourceState.SILENT: ("It is offered and nothing comes", "Look at the program that makes it"),
    SourceState.STALE: ("It came and stopped", "Look at the program that makes it"),
    SourceState.QOS_MISMATCH: (
        "Publisher and gateway ask for different guarantees: nothing can come",
        "Change reliability or durability of this source in the gateway's configuration",
    ),
    SourceState.WRONG_TYPE: (
        "Publisher and gateway mean different types: nothing can come",
        "Correct the type of this source in the gateway's configuration",
    ),
    SourceState.TYPE_MISSING: ("It can't be read", "Type on the robot: robot-gateway doctor"),
    SourceState.UNKNOWN: ("The gateway is newer than this program", "Update this program"),
}


def source_findings(status: SystemStatus) -> Iterator[Finding]:
    """Every source that is not told as a fault already."""
    told = {fault.id.rpartition(".")[0] for fault in status.faults if fault.active}
    for source in status.sources:
        check = f"source.{source.name}"
        if source.state is SourceState.RECEIVING:
            yield good(check, f"comes, {source.age_ms} ms old")
        elif source.name not in told:
            yield note(check, source.detail or source.state.value, *_WHY[source.state])


def encoder_finding(status: SystemStatus) -> Finding:
    """Whether the encoder has proved itself: an encoder that runs has."""
    preview = status.preview
    if preview.state is PreviewState.RUNNING and preview.encoder:
        kind = "hardware" if preview.encoder.hardware else "the robot's processor"
        return good("encoder", f"{preview.encoder.name} ({kind}) delivers pictures")
    if preview.state is PreviewState.FAULTED:
        return wrong(
            "encoder",
            f"no picture: {preview.last_error}",
            "The preview is wanted and does not work",
            "Type on the robot: robot-preview encoders",
        )
    return note(
        "encoder",
        f"not proven: the preview is {preview.state.value}",
        "Whether an encoder works is known only when it runs",
        "Type: robotctl preview on; robotctl doctor",
    )


def access_finding(status: SystemStatus) -> Finding | None:
    """Whether everybody on the network may do what this computer may."""
    if not status.insecure:
        return None
    return note(
        "access",
        "the gateway serves everybody who reaches it, unencrypted",
        "Whoever is on that network may read and switch everything",
        "Set security.insecure to false in the gateway's configuration, and use a tunnel",
    )


def calls_finding(info: GatewayInfo) -> Finding:
    """Calls that ended with the gateway's own error."""
    failed = sum(counts.failed for counts in info.methods)
    if failed == 0:
        return good("calls", f"{info.gateway.requests_served or 0} calls answered, none failed")
    return wrong(
        "calls",
        f"{failed} calls ended with an error of the gateway's own",
        "That is a defect of the gateway",
        "Look into its log for 'failed', and report it",
    )


def _series(version: str) -> list[str]:
    return version.split(".")[:2]
