"""Metrics of driving."""

from collections.abc import Iterator

from prometheus_client.core import Metric

from gateway.metrics.families import counter, gauge, gauges
from gateway.status.teleop import DrivePhase, TeleopView


def of_driving(teleop: TeleopView, link_failures: int) -> Iterator[Metric]:
    """Yields the families."""
    drive = teleop.drive
    phases = {each.value: float(drive.phase is each) for each in DrivePhase}
    yield gauges("drive_phase", "1 for the phase of driving.", "phase", phases)
    yield gauge("drive_reachable", "1 while the drive program answers.", drive.reachable)
    yield gauge("drive_link_failures", "Failures in a row to connect to the drive program.", link_failures)
    yield gauge("drive_leased", "1 while a driver has the lease.", bool(teleop.holder))
    if drive.actual is None:
        return
    # Of the present process of the drive program: they start again with the next, as counters may.
    counters = drive.actual.counters
    yield counter("drive_commands", "Commands that counted.", counters.commands)
    ignored = "Commands that did not count: repeated, or of another session."
    yield counter("drive_commands_ignored", ignored, counters.ignored)
    inhibited = "Times that a reason stopped the robot while its driver held."
    yield counter("drive_inhibited", inhibited, counters.inhibited)
    yield counter("drive_stops", "Stops.", counters.stops)
    yield counter("drive_published", "Velocity messages published.", counters.published)
    yield counter("drive_late_cycles", "Cycles that began more than 5 ms late.", counters.late_cycles)
