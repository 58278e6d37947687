"""`robot-drive doctor`: the program, the graph, and on request a short motion."""

from collections.abc import Iterator
from pathlib import Path

from common.config_finding import checked_settings
from common.errors import UserError
from common.findings import Finding, note, wrong
from common.ros_transport_findings import transport_finding
from drive.client import observed_state
from drive.config import DriveSettings
from drive.doctor.judgement import graph_findings, program_findings, pulse_findings
from drive.wire import RESTING_PHASES
from omniseer.drive.v1 import drive_pb2 as pb


def examine(config_file: Path | None, *, with_pulse: bool) -> Iterator[Finding]:
    """Yields the findings on this machine.

    Args:
        config_file: of the program.
        with_pulse: whether the robot may be moved, forward by a few centimetres.
    """
    settings = yield from checked_settings(DriveSettings, config_file, "robot-drive")
    if settings is None:
        return
    state = None
    try:
        state = observed_state(settings.socket)
        yield from program_findings(state)
    except UserError as error:
        yield note("drive", error.what, "Driving is impossible", error.remedy)
    try:
        yield from _graph(settings, state, with_pulse=with_pulse)
    except UserError as error:
        yield wrong("ros", error.what, "Without ROS 2 nothing can be driven", error.remedy)


def _graph(settings: DriveSettings, state: pb.ActualState | None, *, with_pulse: bool) -> Iterator[Finding]:
    # Late: without ROS 2 the rest is still examined.
    from common.ros_node import OwnNode, middleware_name, ros_node  # noqa: PLC0415
    from drive.doctor.graph import look, pulse  # noqa: PLC0415

    yield from transport_finding(middleware_name())
    with ros_node(OwnNode.DRIVE_DOCTOR) as node:
        yield from graph_findings(look(node, settings))
        if not with_pulse:
            return
        if state and state.phase not in RESTING_PHASES:
            yield note(
                "pulse",
                "the pulse was left out: a driver has the robot, or it was stopped",
                "Two sources on one input would mix",
                "Try again when no driver has the robot and no stop is latched",
            )
            return
        yield from pulse_findings(pulse(node, settings))
