"""The metrics by name. docs/fleet.md explains each; a test holds the page and this module together."""

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

from prometheus_client.core import CounterMetricFamily as CounterFamily
from prometheus_client.core import GaugeMetricFamily as Gauge
from prometheus_client.core import Metric

from common.collector import InstantCollector
from fleet.enrolment import is_revoked
from fleet.names import ROBOT_NAME
from fleet.reading import NotReadableError, robot_state
from fleet.standing import Evidence, Standing, standing
from hub.jetstream.streams import StreamUse
from omniseer.fleet.v1.state_pb2 import RobotState
from omniseer.gateway.v1 import fault_pb2, value_pb2

_PREFIX: Final = "robot_fleet"
_MS_PER_S: Final = 1000
MOST_ROBOTS: Final = 10_000
"""Further ones get no metrics, and are counted up to as many again: Prometheus keeps a time series for each
name that it has ever seen."""
MOST_SERIES: Final = 64
"""Values of one robot that get time series until the exporter is started again: a thief of its key could name
others in each state."""
_LABEL: Final = re.compile(r"[a-z][a-z0-9_]{0,39}")
_LONGEST_LABEL: Final = 64
_TEXT_LEVELS: Final[Mapping["value_pb2.TextLevel.ValueType", int]] = {
    value_pb2.TEXT_LEVEL_GOOD: 0,
    value_pb2.TEXT_LEVEL_WARNING: 1,
    value_pb2.TEXT_LEVEL_ERROR: 2,
}
_SEVERITIES: Final[Mapping["fault_pb2.FaultSeverity.ValueType", str]] = {
    fault_pb2.FAULT_SEVERITY_INFO: "info",
    fault_pb2.FAULT_SEVERITY_WARNING: "warning",
    fault_pb2.FAULT_SEVERITY_ERROR: "error",
}


@dataclass(frozen=True, slots=True)
class SeenState:
    """The newest value of a robot's key.

    Attributes:
        state: None if it is not readable.
        received_unix_ms: When the hub took it, by the hub's clock.
    """

    state: RobotState | None
    received_unix_ms: int


@dataclass(frozen=True, slots=True)
class RobotSample:
    """An enrolled robot at one instant.

    Attributes:
        name: Its name.
        standing: Where it stands.
        age_s: Age of its newest state; None without one.
        state: None if it was never seen or is not readable.
    """

    name: str
    standing: Standing
    age_s: float | None
    state: RobotState | None


@dataclass(eq=False)
class FleetCollector(InstantCollector):
    """Keeps what the hub has about enrolled robots, and collects all metrics at one instant.

    Attributes:
        now_unix_ms: Returns the hub's time.
        connected: Returns whether the hub answers.
    """

    now_unix_ms: Callable[[], int]
    connected: Callable[[], bool]
    _enrolled: dict[str, bool] = field(default_factory=dict)
    _states: dict[str, SeenState] = field(default_factory=dict)
    _left_out: set[str] = field(default_factory=set)
    _uses: dict[str, StreamUse] = field(default_factory=dict)
    _series: dict[str, set[tuple[str, ...]]] = field(default_factory=dict)

    def take_robot(self, name: str, entry: bytes, *, deleted: bool) -> None:
        """Takes an entry of the hub's list."""
        if deleted:
            self._enrolled.pop(name, None)
            self._series.pop(name, None)
            self._left_out.discard(name)
        elif not ROBOT_NAME.fullmatch(name):
            return
        elif name in self._enrolled or len(self._enrolled) < MOST_ROBOTS:
            self._enrolled[name] = is_revoked(entry)
            self._left_out.discard(name)
        elif len(self._left_out) < MOST_ROBOTS:
            self._left_out.add(name)
            self._states.pop(name, None)

    def take_state(self, name: str, value: bytes, received_unix_ms: int, *, deleted: bool) -> None:
        """Takes a robot's newest state."""
        if deleted:
            self._states.pop(name, None)
        elif name not in self._left_out and (name in self._states or len(self._states) < MOST_ROBOTS):
            self._states[name] = SeenState(_state(name, value), received_unix_ms)

    def take_use(self, use: StreamUse) -> None:
        """Takes how full a stream is."""
        self._uses[use.stream] = use

    def collect(self) -> Iterator[Metric]:
        """Yields every family."""
        robots = [self._sample(name) for name in sorted(self._enrolled)]
        yield Gauge(f"{_PREFIX}_hub_connected", "1 while the hub answers.", value=self.connected())
        yield Gauge(
            f"{_PREFIX}_robots_left_out",
            f"Robots of the hub's list beyond {MOST_ROBOTS}, which have no metrics.",
            value=len(self._left_out),
        )
        yield _uses(self._uses.values())
        yield _standings(robots)
        current = [robot for robot in robots if robot.standing is not Standing.REVOKED]
        up = {robot.name: float(robot.standing is Standing.UP) for robot in current}
        yield _gauge("up", "1 while bridge and gateway are up.", up)
        ages = {robot.name: robot.age_s for robot in current if robot.age_s is not None}
        yield _gauge("last_seen_seconds", "Age of the newest state, by the hub's clock.", ages)
        states = {robot.name: robot.state for robot in current if robot.state}
        yield from _of_states(states)
        yield self._numbers(states)
        yield self._texts(states)

    def _numbers(self, states: Mapping[str, RobotState]) -> Metric:
        found: dict[tuple[str, ...], float] = {}
        for name, state in states.items():
            for each in state.numbers:
                known = each.available and not each.stale and each.HasField("value")
                if known and math.isfinite(each.value):
                    self._take_value(found, name, each.label, (f"number.{each.label}", each.unit), each.value)
        family = Gauge(
            f"{_PREFIX}_number",
            "Numbers that the robot's configuration names; absent while stale or unknown.",
            labels=("robot", "source", "unit"),
        )
        for labels, value in found.items():
            family.add_metric(labels, value)
        return family

    def _texts(self, states: Mapping[str, RobotState]) -> Metric:
        found: dict[tuple[str, ...], float] = {}
        for name, state in states.items():
            for each in state.texts:
                level = _TEXT_LEVELS.get(each.level)
                if each.available and not each.stale and level is not None:
                    self._take_value(found, name, each.label, (f"text.{each.label}",), level)
        family = Gauge(
            f"{_PREFIX}_text_level",
            "Texts of the robot's configuration: 0 good, 1 warning, 2 error; absent while stale or unknown.",
            labels=("robot", "source"),
        )
        for labels, value in found.items():
            family.add_metric(labels, value)
        return family

    def _take_value(
        self,
        found: dict[tuple[str, ...], float],
        robot: str,
        label: str,
        labels: tuple[str, ...],
        value: float,
    ) -> None:
        """Takes a value that may be a time series: its label is one, and it is among the robot's first ones.

        The first of equal names counts: with the same series twice Prometheus refuses the whole page.
        """
        if not _LABEL.fullmatch(label) or any(len(each) > _LONGEST_LABEL for each in labels):
            return
        known = self._series.setdefault(robot, set())
        if labels not in known and len(known) < MOST_SERIES:
            known.add(labels)
        if labels in known:
            found.setdefault((robot, *labels), value)

    def _sample(self, name: str) -> RobotSample:
        seen = self._states.get(name)
        age_s = max(0, self.now_unix_ms() - seen.received_unix_ms) / _MS_PER_S if seen else None
        state = seen.state if seen else None
        evidence = Evidence(
            enrolled=True,
            revoked=self._enrolled[name],
            age_s=age_s,
            readable=state is not None,
            gateway_reachable=state is not None and state.gateway_reachable,
        )
        return RobotSample(name, standing(evidence), age_s, state)


def _uses(uses: Iterable[StreamUse]) -> Metric:
    family = Gauge(
        f"{_PREFIX}_stream_used_ratio", "How full a stream is: 1 takes nothing more.", labels=("stream",)
    )
    for each in uses:
        family.add_metric((each.stream,), each.ratio)
    return family


def _standings(robots: list[RobotSample]) -> Metric:
    counts = Counter(robot.standing for robot in robots)
    family = Gauge(f"{_PREFIX}_robots", "Enrolled robots, by where they stand.", labels=("standing",))
    for each in Standing:
        if each is not Standing.NOT_ENROLLED:
            family.add_metric((each.value,), counts[each])
    return family


def _of_states(states: Mapping[str, RobotState]) -> Iterator[Metric]:
    """What robots last reported, those that are away included: `up` says which."""
    yield _gauge("ready", "1 while the robot can take work.", {name: it.ready for name, it in states.items()})
    faults = Gauge(
        f"{_PREFIX}_faults", "Active faults by severity, of the 8 worst.", labels=("robot", "severity")
    )
    for name, state in states.items():
        counts = Counter(fault.severity for fault in state.faults)
        for number, severity in _SEVERITIES.items():
            faults.add_metric((name, severity), counts[number])
    yield faults
    yield _gauge(
        "battery_percent",
        "State of charge; absent if it is not known.",
        {name: it.battery_percent for name, it in states.items() if it.HasField("battery_percent")},
    )
    yield _gauge(
        "disk_used_percent",
        "Used part of the robot's disk; absent if it is not known.",
        {name: it.disk_used_percent for name, it in states.items() if it.HasField("disk_used_percent")},
    )
    yield _gauge(
        "outbox_events",
        "Events that wait in the robot.",
        {name: it.outbox_events for name, it in states.items()},
    )
    yield _gauge(
        "uploads", "Uploads that run or wait.", {name: it.upload_count for name, it in states.items()}
    )
    yield _gauge(
        "recordings_to_copy",
        "Recordings that still have to be copied.",
        {name: it.recordings_to_copy for name, it in states.items()},
    )
    rates = {name: sum(each.bytes_per_s for each in it.uploads) for name, it in states.items()}
    yield _gauge("upload_bytes_per_second", "At present.", rates)
    dropped = CounterFamily(
        f"{_PREFIX}_events_dropped", "Events dropped since the robot's outbox was made.", labels=("robot",)
    )
    for name, state in states.items():
        dropped.add_metric((name,), state.events_dropped)
    yield dropped


def _gauge(name: str, what: str, values: Mapping[str, float]) -> Metric:
    family = Gauge(f"{_PREFIX}_{name}", what, labels=("robot",))
    for robot, value in values.items():
        family.add_metric((robot,), value)
    return family


def _state(name: str, value: bytes) -> RobotState | None:
    try:
        return robot_state(name, value)
    except NotReadableError:
        return None
