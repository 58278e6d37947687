"""The snapshot: the newest values of one instant, their freshness, and the health that follows from them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from gateway.status.access import UNGUARDED, AccessView
from gateway.status.board import Board
from gateway.status.cloud import CloudView
from gateway.status.command import Command, effective_command
from gateway.status.event_log import OperatorEvent
from gateway.status.fault import Fault
from gateway.status.freshness import ABSENT, Sample, sample
from gateway.status.health import NOT_READ, RobotHealth, assess
from gateway.status.pictures import NO_PICTURES, Pictures
from gateway.status.preview import Measurement, PreviewView
from gateway.status.recording import RecorderView
from gateway.status.source_view import SourceView, source_view
from gateway.status.sources import (
    EFFECTIVE_COMMAND,
    MUX_INPUTS,
    PLATFORM_SOURCES,
    ROS_SOURCES,
    SourceSpec,
    ValueT,
)
from gateway.status.teleop import TeleopView

MEASUREMENT_STALE_AFTER_MS: Final = 2000
ROS_STALLED_AFTER_S: Final = 2.0
"""Forty passes of the ROS sampler: it hangs in the middleware, or the computer is overloaded."""
_ROS_LATE_AFTER_S: Final = 0.25
"""Five passes: a value that has become stale meanwhile is no longer about to be judged by the next one."""


@dataclass(frozen=True, slots=True)
class Identity:
    """Name and version of the gateway, and whether it serves unencrypted or without authentication."""

    name: str
    version: str
    insecure: bool


@dataclass(frozen=True, slots=True)
class Runtime:
    """Build and counters of the running gateway.

    Attributes:
        revision: source revision of the build; empty if unknown.
        boot_id: the kernel's boot ID; empty if unknown.
        uptime_ms: since the gateway started.
        client_count: connections with a recent request.
        requests_served: calls answered since the start.
        requests_refused: calls refused since the start.
        run_id: unique for each start of the gateway; qualifies the sequence numbers of events.
    """

    revision: str
    boot_id: str
    uptime_ms: int
    client_count: int
    requests_served: int
    requests_refused: int
    run_id: str = ""


@dataclass(frozen=True, slots=True)
class SourceRule:
    """The expectations of one source."""

    stale_after_ms: int
    required: bool


@dataclass(frozen=True, slots=True)
class Rules:
    """The expectations of the robot.

    Attributes:
        sources: the configured ones, in the order they are shown.
        ignored_by_health: fault ids, or their beginnings up to a dot, whose errors don't degrade the health.
    """

    sources: Mapping[SourceSpec[Any], SourceRule]
    platform_stale_after_ms: int
    ignored_by_health: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The status at `at_s` (seconds, monotonic). Maps each source to its sample.

    Attributes:
        samples: of the configured sources and of the platform.
        command: the effective command with the mux input it is attributed to.
        sources: the state of each configured source.
        events: the overlay's short list, oldest first.
        pictures: what viewers report of the pictures that they show.
        teleop: driving; None where the robot is not set up for it.
        recorder: recording; None where the robot is not set up for it.
        cloud: the connection to the fleet; None where the robot is not set up for one.
        ros_stalled: whether the ROS sampler makes no progress, so that the sources' ages accuse no publisher.
    """

    at_s: float
    identity: Identity
    gateway: Runtime
    health: RobotHealth
    samples: Mapping[SourceSpec[Any], Sample[Any]]
    command: Sample[Command]
    preview: PreviewView
    preview_measured: Sample[Measurement]
    pictures: Pictures
    sources: tuple[SourceView, ...]
    events: tuple[OperatorEvent, ...]
    faults: tuple[Fault, ...]
    access: AccessView
    ros_stalled: bool
    teleop: TeleopView | None = None
    recorder: RecorderView | None = None
    cloud: CloudView | None = None

    def __getitem__(self, spec: SourceSpec[ValueT]) -> Sample[ValueT]:
        """Returns the sample of a source; an absent one if the source is not configured."""
        return self.samples.get(spec, ABSENT)


_UNKNOWN: Final = Runtime("", "", 0, 0, 0, 0)


@dataclass(frozen=True, slots=True)
class Setup:
    """What stays the same while the gateway runs."""

    identity: Identity
    rules: Rules


@dataclass(frozen=True, slots=True)
class Programs:
    """The robot's other programs at one instant, as far as the robot is set up for them."""

    preview: PreviewView
    teleop: TeleopView | None = None
    recorder: RecorderView | None = None
    cloud: CloudView | None = None


@dataclass(frozen=True, slots=True)
class Noted:
    """What the gateway itself has noted at one instant.

    Attributes:
        events: the overlay's short list, oldest first.
        faults: present ones, and those that were cleared a short while ago.
        pictures: what viewers report of the pictures that they show.
    """

    events: tuple[OperatorEvent, ...] = ()
    faults: tuple[Fault, ...] = ()
    gateway: Runtime = _UNKNOWN
    access: AccessView = UNGUARDED
    pictures: Pictures = NO_PICTURES


NOTHING_NOTED: Final = Noted()


def take(
    setup: Setup, board: Board, programs: Programs, now_s: float, noted: Noted = NOTHING_NOTED
) -> Snapshot:
    """Returns the snapshot of `now_s`. Reads memory only, so that a call never waits for ROS or the disk."""
    rules, preview = setup.rules, programs.preview
    configured = rules.sources
    samples = {spec: sample(board[spec], rule.stale_after_ms, now_s) for spec, rule in configured.items()}
    for spec in PLATFORM_SOURCES:
        samples[spec] = sample(board[spec], rules.platform_stale_after_ms, now_s)
    unpassed_s = 0.0 if board.ros_passed_s is None else now_s - board.ros_passed_s
    ros_stalled = unpassed_s > ROS_STALLED_AFTER_S
    since_pass = {
        spec for spec, rule in configured.items() if _stale_since_pass(board, spec, rule, samples[spec])
    }
    late = since_pass if unpassed_s > _ROS_LATE_AFTER_S else set()
    if ros_stalled:
        late = set(configured)
    return Snapshot(
        at_s=now_s,
        identity=setup.identity,
        gateway=noted.gateway,
        health=NOT_READ
        if ros_stalled or any(configured[spec].required for spec in late)
        else assess(
            (
                (spec.health_name or spec.display_name, samples[spec].freshness)
                # The table's order, then the configuration's.
                for spec in dict.fromkeys((*ROS_SOURCES, *configured))
                if spec in configured and configured[spec].required
            ),
            noted.faults,
            rules.ignored_by_health,
        ),
        samples=samples,
        command=_command(rules, board, now_s),
        preview=preview,
        preview_measured=sample(preview.measured, MEASUREMENT_STALE_AFTER_MS, now_s),
        pictures=noted.pictures,
        sources=tuple(
            source_view(
                spec,
                samples[spec].freshness,
                board.publishers.get(spec),
                required=rule.required,
                unusable=board.unusable.get(spec),
                undecodable=spec in board.undecodable,
                stale_since_pass=spec in since_pass,
                sampler_late=spec in late,
            )
            for spec, rule in configured.items()
        ),
        events=noted.events,
        faults=noted.faults,
        access=noted.access,
        ros_stalled=ros_stalled,
        teleop=programs.teleop,
        recorder=programs.recorder,
        cloud=programs.cloud,
    )


def _stale_since_pass(board: Board, spec: SourceSpec[Any], rule: SourceRule, now: Sample[Any]) -> bool:
    """Returns whether a value is stale now, but was not at the sampler's last pass: a newer one may wait."""
    passed_s = board.ros_passed_s
    if passed_s is None or not now.freshness.stale:
        return False
    return not sample(board[spec], rule.stale_after_ms, passed_s).freshness.stale


def _command(rules: Rules, board: Board, now_s: float) -> Sample[Command]:
    rule = rules.sources.get(EFFECTIVE_COMMAND)
    if rule is None:
        return ABSENT
    inputs = {source: command for source, spec in MUX_INPUTS.items() if (command := board[spec])}
    return effective_command(board[EFFECTIVE_COMMAND], inputs, rule.stale_after_ms, now_s)
