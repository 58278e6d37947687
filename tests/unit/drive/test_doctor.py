"""What the doctor makes of what it has found."""

from dataclasses import replace

import pytest

from common.findings import Finding, Verdict
from drive.doctor.facts import GraphFacts, PulseFacts, Rank, TopicFacts
from drive.doctor.judgement import graph_findings, program_findings, pulse_findings
from drive.doctor.ranking import ranks_in, wanted
from omniseer.drive.v1 import drive_pb2 as pb

STAMPED = "geometry_msgs/msg/TwistStamped"
INPUT = TopicFacts("/cmd_vel_keyboard", STAMPED, (), ("twist_mux",), frozenset({STAMPED}))
REACHING = TopicFacts("/reference", STAMPED, ("twist_mux",), ("controller",), frozenset({STAMPED}))
LOCK = TopicFacts("/lock", "std_msgs/msg/Bool", (), ("twist_mux",))
ODOMETRY = TopicFacts("/odom", "nav_msgs/msg/Odometry", ("ekf",))
RANKS = (Rank("/nav", 1, 0.5), Rank("/cmd_vel_keyboard", 3, 0.5), Rank("/lock", 255, lock=True))
GOOD = GraphFacts(
    outputs=[INPUT],
    mux_output=REACHING,
    lock=LOCK,
    odometry=ODOMETRY,
    timeouts={"controller: reference_timeout": 1.0},
    ranks=RANKS,
)


def verdicts(facts: GraphFacts) -> dict[str, Finding]:
    return {each.check: each for each in graph_findings(facts)}


def test_a_good_robot_has_nothing_to_mend() -> None:
    assert {each.verdict for each in graph_findings(GOOD)} == {Verdict.GOOD}


@pytest.mark.parametrize(
    ("facts", "check", "verdict", "said"),
    [
        (
            replace(GOOD, outputs=[replace(INPUT, subscribers=())]),
            "mux/cmd_vel_keyboard",
            Verdict.WRONG,
            "nothing",
        ),
        (
            replace(GOOD, outputs=[replace(INPUT, types=frozenset({"geometry_msgs/msg/Twist"}))]),
            "mux/cmd_vel_keyboard",
            Verdict.WRONG,
            "geometry_msgs/msg/Twist",
        ),
        (
            replace(GOOD, outputs=[replace(INPUT, publishers=("teleop_keyboard",))]),
            "mux/cmd_vel_keyboard.shared",
            Verdict.NOTE,
            "teleop_keyboard",
        ),
        (
            replace(GOOD, lock=replace(LOCK, subscribers=())),
            "mux.lock",
            Verdict.NOTE,
            "nothing takes the lock",
        ),
        (replace(GOOD, lock=replace(LOCK, publishers=("button",))), "mux.lock", Verdict.WRONG, "button"),
        (replace(GOOD, mux_output=None), "base", Verdict.NOTE, "mux_output is not set"),
        (replace(GOOD, mux_output=replace(REACHING, subscribers=())), "base", Verdict.WRONG, "no base"),
        (
            replace(GOOD, mux_output=replace(REACHING, publishers=("twist_mux", "nav"))),
            "base.bypassed",
            Verdict.WRONG,
            "nav",
        ),
        (replace(GOOD, foreign_motion=20), "base.driven", Verdict.NOTE, "20"),
        (replace(GOOD, stops=[TopicFacts("/stop", "x")]), "stop/stop", Verdict.WRONG, "nothing publishes"),
        (replace(GOOD, stops=[TopicFacts("/stop", "x", ("a", "b"))]), "stop/stop", Verdict.WRONG, "a, b all"),
        (replace(GOOD, odometry=replace(ODOMETRY, publishers=())), "odometry", Verdict.NOTE, "/odom"),
        (replace(GOOD, ranks=(*RANKS, Rank("/joy", 3))), "mux.priority", Verdict.NOTE, "/joy (priority 3)"),
        (replace(GOOD, ranks=(*RANKS, Rank("/joy", 9))), "mux.priority", Verdict.NOTE, "/joy (priority 9)"),
        (
            replace(GOOD, ranks=(*RANKS, Rank("/joy", 255))),
            "mux.lock.priority",
            Verdict.WRONG,
            "/joy (priority 255)",
        ),
        (
            replace(GOOD, ranks=(*RANKS[:2], Rank("/lock", 255, 0.5, lock=True))),
            "mux.lock.timeout",
            Verdict.WRONG,
            "0.5 s",
        ),
        (replace(GOOD, timeouts={}), "base.timeout", Verdict.NOTE, "no node"),
        (replace(GOOD, timeouts={"a: x": 0.5, "b: y": 0.0}), "base.timeout", Verdict.WRONG, "b: y"),
        (replace(GOOD, timeouts={"a: x": 2.0}), "base.timeout", Verdict.NOTE, "2 s"),
    ],
)
def test_what_is_wrong_is_said(facts: GraphFacts, check: str, verdict: Verdict, said: str) -> None:
    finding = verdicts(facts)[check]
    assert finding.verdict is verdict
    assert said in finding.what
    assert finding.why


@pytest.mark.parametrize("ranks", [(), RANKS[:1]])
def test_a_multiplexer_that_does_not_say_how_it_ranks_is_a_doubt(ranks: tuple[Rank, ...]) -> None:
    found = verdicts(replace(GOOD, ranks=ranks))
    for check in ("mux.priority", "mux.lock.priority"):
        assert found[check].verdict is Verdict.NOTE
        assert "says how it ranks it" in found[check].what


def test_without_a_multiplexer_nothing_ranks() -> None:
    facts = replace(GOOD, mux_output=None, lock=None, ranks=())
    assert not {"mux.priority", "mux.lock.priority"} & verdicts(facts).keys()


def test_of_several_inputs_of_our_own_the_highest_counts() -> None:
    outputs = [INPUT, replace(INPUT, name="/low")]
    facts = replace(GOOD, outputs=outputs, ranks=(*RANKS, Rank("/low", 0)))
    assert verdicts(facts)["mux.priority"].verdict is Verdict.GOOD


def test_the_ranks_are_read_out_of_the_parameters_of_twist_mux() -> None:
    values = {
        "topics.navigation.topic": "cmd_vel_nav",
        "topics.navigation.priority": 1,
        "topics.navigation.timeout": 0.5,
        "topics.navigation.short_desc": "by itself",
        "locks.stop.topic": "/lock",
        "locks.stop.priority": 255,
        "locks.stop.timeout": 0.0,
        "topics.half.topic": "/half",
        "topics.wrong.topic": "/wrong",
        "topics.wrong.priority": "high",
    }
    assert "topics.navigation.short_desc" not in wanted(values)
    assert ranks_in({name: values[name] for name in wanted(values)}) == (
        Rank("/cmd_vel_nav", 1, 0.5),
        Rank("/lock", 255, lock=True),
    )
    assert ranks_in(values, "left/arm")[0].topic == "/left/arm/cmd_vel_nav"


@pytest.mark.parametrize(
    ("facts", "expected"),
    [
        (PulseFacts(0.05, 0.05, 1.0), {"pulse": Verdict.GOOD, "pulse.timeout": Verdict.GOOD}),
        (PulseFacts(0.05, 0.05, None), {"pulse": Verdict.GOOD, "pulse.timeout": Verdict.WRONG}),
        (PulseFacts(0.05, 0.0, 0.1), {"pulse": Verdict.WRONG}),
        (PulseFacts(0.05, None, None), {"pulse": Verdict.WRONG}),
    ],
)
def test_a_pulse_is_judged_by_odometry(facts: PulseFacts, expected: dict[str, Verdict]) -> None:
    assert {each.check: each.verdict for each in pulse_findings(facts)} == expected


def test_the_program_says_what_it_waits_for() -> None:
    state = pb.ActualState(
        phase=pb.PHASE_STOPPED,
        stop=pb.Latch(stop_id=1, by="ben", reason="a child"),
        inhibits=[pb.INHIBIT_BASE_ABSENT],
        counters=pb.Counters(worker_kills=2),
    )
    found = {each.check: each.what for each in program_findings(state)}
    assert "ben: a child" in found["drive.stop"]
    assert "BASE_ABSENT" in found["drive.inhibits"]
    assert "2 workers" in found["drive.late"]
