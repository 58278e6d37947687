"""The status by component: marks say in a word what the colour says, ages count on when nothing comes."""

from dataclasses import replace

import pytest

from console.client import Unreachable
from console.monitor.components import Component, components
from console.monitor.link import Link, LinkState
from console.monitor.monitor_state import MonitorState
from console.tone import Tone
from omniseer.gateway.v1 import overlay_pb2, source_pb2
from omniseer.gateway.v1 import states_pb2 as states
from tests.support.snapshots import NOW_S, heard, snapshot


def by_name(state: MonitorState, now_s: float = NOW_S) -> dict[str, Component]:
    return {line.name: line for line in components(state, now_s)}


def test_a_healthy_robot() -> None:
    lines = by_name(heard())
    assert lines["Motion"] == Component(
        "Motion", "fresh", Tone.GOOD, "0.50\u00a0m/s, turning\u00a0+0.30\u00a0rad/s", "12 ms"
    )
    assert lines["Vision"].values == "29.5\u00a0fps, inference\u00a012.5\u00a0ms"
    assert lines["Battery"].values == "78\u00a0%"
    assert (lines["Objects"].mark, lines["Objects"].tone) == ("no data", Tone.QUIET)
    assert "Network" not in lines, "what the robot never told has no line"


def test_nothing_is_claimed_before_the_first_answer() -> None:
    assert components(MonitorState(Link(state=LinkState.CONNECTING, since_s=0)), NOW_S) == []


def test_stale_is_a_word_and_a_tone() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        made.status.vision.stale, made.status.vision.age_ms = True, 3400

    vision = by_name(heard(snapshot(change)))["Vision"]
    assert (vision.mark, vision.tone, vision.age) == ("STALE", Tone.WARNING, "3.4 s")


def test_ages_count_on_between_two_answers() -> None:
    assert by_name(heard(), NOW_S + 1)["Motion"].age == "1.0 s"
    assert by_name(heard(), NOW_S + 1)["Motion"].mark == "fresh"


@pytest.mark.parametrize("silent_s", [2.1, 60.0])
def test_what_was_fresh_when_the_robot_fell_silent_is_stale_now(silent_s: float) -> None:
    """A connection that hangs looks connected for a while."""
    motion = by_name(heard(), NOW_S + silent_s)["Motion"]
    assert (motion.mark, motion.tone) == ("STALE", Tone.WARNING)


def test_without_a_connection_nothing_is_fresh() -> None:
    link = Link(state=LinkState.LOST, since_s=NOW_S, error=Unreachable("gone"), attempts=1)
    lines = components(replace(heard(), link=link), NOW_S)
    assert {line.mark for line in lines} == {"STALE", "no data"}


def test_why_a_source_can_never_come_has_a_line() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        for name, state in (
            ("odometry", source_pb2.SOURCE_STATE_QOS_MISMATCH),
            ("mux_input", source_pb2.SOURCE_STATE_SILENT),
        ):
            made.status.sources.add(name=name, state=state, required=True, detail=f"{name}: because")

    lines = by_name(heard(snapshot(change)))
    assert lines["Odometry"] == Component("Odometry", "no data", Tone.WARNING, "odometry: because", "")
    assert "Mux input" not in lines


def test_how_the_robot_is_set_up() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        made.status.insecure = True
        made.status.teleop.state = states.TELEOP_ENABLED
        made.status.teleop.enabled = True
        made.status.teleop.max_linear_mps = 0.5
        made.status.gateway.boot_id, made.status.gateway.uptime_ms = "a", 90_000
        made.status.gateway.client_count = 2

    lines = by_name(heard(snapshot(change)))
    assert (lines["Access"].mark, lines["Access"].tone) == ("OPEN", Tone.WARNING)
    assert (lines["Teleop"].mark, lines["Teleop"].tone) == ("enabled", Tone.GOOD)
    assert (lines["Gateway"].values, lines["Gateway"].age) == ("2 clients", "1 min 30 s")
    assert not {"Access", "Teleop", "Gateway"} & by_name(heard()).keys()
    assert "Gateway" not in by_name(heard(snapshot(change)), NOW_S + 60), "nobody knows whether it is up"


def test_a_line_never_breaks_between_a_number_and_its_unit() -> None:
    def change(made: overlay_pb2.OverlaySnapshot) -> None:
        compute = made.status.platform.compute
        compute.available, compute.cpu_percent, compute.ram_used_percent = True, 34, 41
        compute.cpu_temperature_available, compute.cpu_temperature_c = True, 51
        compute.thermal_throttled_available = compute.thermal_throttled = True

    computer = by_name(heard(snapshot(change)))["Computer"]
    assert computer.values.replace("\u00a0", " ") == "CPU 34 %, 51 °C, slowed by heat, memory 41 %"
    assert all("," in part for part in computer.values.split(" ")[:-1])
