"""`robot-drive doctor`: the program, the graph, and on request a short motion."""

from collections.abc import Iterator
from pathlib import Path

from common.config_finding import checked_settings
from common.errors import UserError
from common.findings import Finding, note, wrong
from common.ros_transport_findings import transport_finding
from drive.config import DriveSettings
from drive.doctor.judgement import graph_findings, program_findings, pulse_findings
from drive.endpoint.client import observed_state


def examine(config_file: Path | None, *, with_pulse: bool) -> Iterator[Finding]:
    """Yields the findings on this machine.

    Args:
        config_file: of the program.
        with_pulse: whether the robot may be moved, forward by a few centimetres.
    """
    settings = yield from checked_settings(DriveSettings, config_file, "robot-drive")
    if settings is None:
        return
    try:
        yield from program_findings(observed_state(settings.socket))
    except UserError as error:
        yield note("drive", error.what, "Driving is impossible", error.remedy)
    try:
        yield from _graph(settings, config_file, with_pulse=with_pulse)
    except UserError as error:
        yield wrong("ros", error.what, "Without ROS 2 nothing can be driven", error.remedy)


def _graph(settings: DriveSettings, config_file: Path | None, *, with_pulse: bool) -> Iterator[Finding]:
    # Late: without ROS 2 the rest is still examined.
    from common.ros_node import OwnNode, middleware_name, readable_names, ros_node  # noqa: PLC0415
    from drive.doctor.graph import look  # noqa: PLC0415
    from drive.doctor.pulse_guard import guarded_pulse  # noqa: PLC0415

    yield from transport_finding(middleware_name())
    with ros_node(OwnNode.DRIVE_DOCTOR) as node, readable_names():
        yield from graph_findings(look(node, settings))
        if with_pulse:
            yield from pulse_findings(guarded_pulse(node, settings, config_file))
