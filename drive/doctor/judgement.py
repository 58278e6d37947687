"""From facts to findings: what is wrong, why it matters, what to do. Pure."""

from collections.abc import Iterator
from typing import Final

from common.findings import Finding, good, note, wrong
from drive.doctor.facts import GraphFacts, PulseFacts, TopicFacts
from drive.doctor.ranking import rank_findings
from omniseer.drive.v1 import drive_pb2 as pb

_OBEYS: Final = 0.5
"""Share of the commanded speed that odometry has to show; wheels start slowly."""
_LONGEST_TIMEOUT_S: Final = 1.5


def program_findings(state: pb.ActualState) -> Iterator[Finding]:
    """Yields what the running program says of itself."""
    phase = pb.Phase.Name(state.phase).removeprefix("PHASE_").lower()
    yield good("drive", f"robot-drive runs; its phase is {phase}")
    if state.HasField("stop"):
        reason = f": {state.stop.reason}" if state.stop.reason else ""
        yield note(
            "drive.stop",
            f"the robot was stopped by {state.stop.by}{reason}",
            "Nothing moves until the stop is reset",
            f"Look at the robot, then type: robotctl reset-stop {state.stop.stop_id}",
        )
    if state.inhibits:
        names = ", ".join(pb.Inhibit.Name(each).removeprefix("INHIBIT_") for each in state.inhibits)
        yield note(
            "drive.inhibits", f"a driver is kept from driving: {names}", "docs/driving.md explains each"
        )
    late, kills = state.counters.late_cycles, state.counters.worker_kills
    if late or kills:
        yield note(
            "drive.late",
            f"{late} cycles began more than 5 ms late, {kills} workers were killed",
            "A machine that is too busy stops the robot without need",
            "Give robot-drive real-time priority (compose.realtime.yaml), or the machine less to do",
        )


def graph_findings(facts: GraphFacts) -> Iterator[Finding]:
    """Yields what the graph shows."""
    for topic in facts.outputs:
        yield from _mux_input(topic)
    if facts.lock:
        yield _lock(facts.lock)
    yield from rank_findings(facts)
    yield from _base(facts)
    for topic in facts.stops:
        yield _stop_topic(topic)
    if facts.odometry:
        yield _odometry(facts.odometry)
    yield _timeout(facts)


def _mux_input(topic: TopicFacts) -> Iterator[Finding]:
    check = f"mux{topic.name}"
    if topic.wrong_types:
        yield wrong(
            check,
            f"{topic.name} is used with {', '.join(topic.wrong_types)}, configured is {topic.type}",
            "The middleware does not connect them: nothing moves",
            "Set the type of this output to that of the multiplexer",
        )
    elif not topic.subscribers:
        yield wrong(
            check,
            f"nothing takes the velocities on {topic.name}",
            "Driving is impossible (BASE_ABSENT)",
            "Start the multiplexer, or set outputs to one of its inputs: ros2 topic list",
        )
    else:
        yield good(check, f"{topic.name} is taken by {', '.join(topic.subscribers)}")
    if topic.publishers:
        yield note(
            f"{check}.shared",
            f"{', '.join(topic.publishers)} publishes on {topic.name}, too",
            "The multiplexer can't distinguish the two: a zero of one does not stop the other",
            "Give robot-drive an input of its own",
        )


def _lock(topic: TopicFacts) -> Finding:
    if not topic.subscribers:
        return note(
            "mux.lock",
            f"nothing takes the lock on {topic.name}",
            "A stop then is zeros alone, which a source of higher priority outranks",
            "Add the lock to the multiplexer, or set lock_topic to null",
        )
    if topic.publishers:
        return wrong(
            "mux.lock",
            f"{', '.join(topic.publishers)} publishes the lock on {topic.name}, too",
            "After the reset of a stop the robot stays locked until that releases it: it might be its lock",
            "Give robot-drive a lock of its own in the multiplexer, of the same priority, and set lock_topic",
        )
    return good("mux.lock", f"{topic.name} is taken by {', '.join(topic.subscribers)}")


def _base(facts: GraphFacts) -> Iterator[Finding]:
    topic = facts.mux_output
    if topic is None:
        yield note(
            "base",
            "mux_output is not set",
            "Whether another source outranks the driver can't be seen",
            "Set it to the topic on which velocities reach the base",
        )
        return
    if topic.wrong_types:
        yield wrong(
            "base",
            f"{topic.name} is used with {', '.join(topic.wrong_types)}, configured is {topic.type}",
            "What reaches the base can't be read: driving ends with OUTRANKED",
            "Set the type of mux_output",
        )
    elif not topic.subscribers:
        yield wrong(
            "base",
            f"no base takes the velocities on {topic.name}",
            "Driving is impossible (BASE_ABSENT)",
            "Start the base's controller, or set mux_output to its topic",
        )
    else:
        yield good("base", f"{topic.name} is taken by {', '.join(topic.subscribers)}")
    if len(topic.publishers) > 1:
        yield wrong(
            "base.bypassed",
            f"{', '.join(topic.publishers)} all publish on {topic.name}",
            "One of them bypasses the multiplexer, and with it every stop",
            "Connect it to an input of the multiplexer",
        )
    if facts.foreign_motion:
        yield note(
            "base.driven",
            f"another source moves the base now ({facts.foreign_motion} velocities in a second)",
            "A driver masks it only if the multiplexer gives the driver's input the higher priority",
        )


def _stop_topic(topic: TopicFacts) -> Finding:
    check = f"stop{topic.name}"
    if len(topic.publishers) > 1:
        return wrong(
            check,
            f"{', '.join(topic.publishers)} all publish the robot's own stop on {topic.name}",
            "Which of them releases is unknown: it counts as pressed, no one can drive (ROBOT_STOP)",
            "Give each a topic of its own, and list them all in stop_topics",
        )
    if topic.publishers:
        return good(check, f"{topic.name} comes from {', '.join(topic.publishers)}")
    return wrong(
        check,
        f"nothing publishes the robot's own stop on {topic.name}",
        "It counts as pressed: driving is impossible (ROBOT_STOP)",
        "Start its publisher, or take the topic out of stop_topics",
    )


def _odometry(topic: TopicFacts) -> Finding:
    if topic.publishers:
        return good("odometry", f"{topic.name} comes from {', '.join(topic.publishers)}")
    return note(
        "odometry",
        f"nothing publishes {topic.name}",
        "After a release a standstill is assumed a second later",
        "Set odometry to the robot's topic, or to null",
    )


def _timeout(facts: GraphFacts) -> Finding:
    """What stops the base when this computer freezes: neither the worker nor the guard can then."""
    why = "If this computer freezes, only the base's own timeout stops the robot"
    if not facts.timeouts:
        return note(
            "base.timeout",
            "no node of the base says after which silence it stops",
            why,
            "Measure it, with room around the robot: robot-drive doctor --pulse; then set base_timeout_ms",
        )
    longest, timeout_s = max(facts.timeouts.items(), key=lambda item: item[1] or float("inf"))
    return timeout_finding("base.timeout", timeout_s or None, longest)


def timeout_finding(check: str, timeout_s: float | None, source: str) -> Finding:
    """Returns the finding on the base's timeout; None: there is none."""
    why = "If this computer freezes, nothing else stops the robot"
    if timeout_s is None:
        return wrong(check, f"the base does not stop by itself ({source})", why, "Set its timeout, to 0.5 s")
    what = f"the base stops {timeout_s:.2g} s after the last velocity ({source})"
    if timeout_s > _LONGEST_TIMEOUT_S:
        return note(check, what, why, "Shorten its timeout, to 0.5 s")
    return good(check, what)


def pulse_findings(facts: PulseFacts) -> Iterator[Finding]:
    """Yields what a test pulse has shown."""
    if facts.interrupted:
        yield note(
            "pulse",
            f"the pulse {facts.interrupted}",
            "The robot is moved only where no one and nothing forbids it",
            "Try again when driving is enabled, no driver has the robot, and no stop is in force",
        )
        return
    if facts.fastest_mps is None:
        yield wrong(
            "pulse",
            "there is no odometry to judge the pulse by",
            "Whether the base obeys can't be seen",
            "Set odometry to the robot's topic",
        )
        return
    seen = f"commanded {facts.commanded_mps:g} m/s, odometry showed {facts.fastest_mps:.2g} m/s"
    if facts.fastest_mps < _OBEYS * facts.commanded_mps:
        yield wrong(
            "pulse",
            f"the base does not obey: {seen}",
            "What an operator commands does not move the robot",
            "Check the multiplexer's priorities and locks, and whether the motors have power",
        )
        return
    yield good("pulse", f"the base obeys: {seen}")
    yield timeout_finding("pulse.timeout", facts.stopped_after_s, "measured without a zero")
