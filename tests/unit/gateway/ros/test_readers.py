"""Readers go by attribute: any object with the right attributes is a message to them."""

import math
from types import SimpleNamespace as Thing
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import UserError
from gateway.config import DEFAULT_SOURCES, SourceSettings
from gateway.ros.readers import reader_for
from gateway.ros.readers.registry import reads
from gateway.status import sources as specs
from gateway.status.board import Board
from gateway.status.values import (
    Battery,
    CommandSource,
    Detection,
    Detections,
    DiagnosticItem,
    DiagnosticLevel,
    Mode,
    Received,
    Velocity,
    Vision,
)


def source(kind: str, message_type: str, **more: Any) -> SourceSettings:
    return SourceSettings(kind=kind, topic="/t", type=message_type, stale_after_ms=1000, **more)


ODOMETRY = source("odometry", "nav_msgs/msg/Odometry")
VISION = source("vision", "omniseer_msgs/msg/VisionPerfSummary")
YOLO = source("detections", "yolo_msgs/msg/DetectionArray", max_items=3)
VISION_MSGS = source("detections", "vision_msgs/msg/Detection2DArray")
BATTERY = source("battery", "sensor_msgs/msg/BatteryState")
DIAGNOSTICS = source("diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
MODE = source("mode", "std_msgs/msg/String")
COMMAND = source("effective_command", "geometry_msgs/msg/TwistStamped")
INPUT = source("mux_input", "geometry_msgs/msg/Twist", label=CommandSource.KEYBOARD)


def read(settings: SourceSettings, message: Any) -> Any:
    return reader_for(settings)(message, settings)


def odometry(vx: float, vy: float, wz: float) -> Thing:
    return Thing(twist=Thing(twist=Thing(linear=Thing(x=vx, y=vy), angular=Thing(z=wz))))


def yolo(x: float = 10, y: float = 20, width: float = 30, height: float = 40, **more: Any) -> Thing:
    fields = {"class_id": 1, "class_name": "car", "score": 0.5, "id": "7"} | more
    bbox = Thing(center=Thing(position=Thing(x=x, y=y)), size=Thing(x=width, y=height))
    return Thing(bbox=bbox, **fields)


def detection2d(*hypotheses: tuple[str, float]) -> Thing:
    results = [Thing(hypothesis=Thing(class_id=class_id, score=score)) for class_id, score in hypotheses]
    bbox = Thing(center=Thing(position=Thing(x=1, y=2)), size_x=3, size_y=4)
    return Thing(results=results, bbox=bbox, id="")


def battery(
    percentage: float = 0.5, voltage: float = 15.0, status: int = 2, *, present: bool = True
) -> Thing:
    return Thing(present=present, voltage=voltage, percentage=percentage, power_supply_status=status)


def test_odometry_reads_the_twist() -> None:
    assert read(ODOMETRY, odometry(0.5, -0.1, 0.25)) == Velocity(0.5, -0.1, 0.25)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e300])
@pytest.mark.parametrize("place", range(3))
def test_odometry_with_a_speed_that_is_no_number_has_no_value(bad: float, place: int) -> None:
    speeds = [0.5, 0.1, 0.2]
    speeds[place] = bad
    assert read(ODOMETRY, odometry(*speeds)) is None


def test_vision_counts_what_is_not_finite_as_none() -> None:
    message = Thing(
        producer_fps=29.5,
        consumer_fps=math.nan,
        last_infer_ms=math.inf,
        infer_error_count=2**63,
        capture_fatal_error_count=1,
    )
    assert read(VISION, message) == Vision(29.5, 0.0, 0.0, 2**63, 1)


def test_yolo_reads_boxes_and_takes_the_picture_from_the_settings() -> None:
    assert read(YOLO, Thing(detections=[yolo()])) == Detections(
        1280, 720, 1, (Detection(1, "car", 0.5, "7", 10, 20, 30, 40),)
    )


def test_detections_are_capped_but_counted() -> None:
    found = read(YOLO, Thing(detections=[yolo(id=str(n)) for n in range(10)]))
    assert found.count == 10
    assert [item.track_id for item in found.items] == ["0", "1", "2"]


@pytest.mark.parametrize(
    "box", [{"x": math.nan}, {"y": math.inf}, {"width": -1}, {"height": math.nan}, {"width": 1e39}]
)
def test_a_box_that_cannot_be_drawn_is_counted_but_not_listed(box: dict[str, float]) -> None:
    found = read(YOLO, Thing(detections=[yolo(**box), yolo(id="good")]))
    assert found.count == 2
    assert [item.track_id for item in found.items] == ["good"]


@pytest.mark.parametrize(("score", "shown"), [(math.nan, 0), (-1, 0), (1.5, 1), (0.3, 0.3), (math.inf, 0)])
def test_a_score_stays_between_0_and_1(score: float, shown: float) -> None:
    assert read(YOLO, Thing(detections=[yolo(score=score)])).items[0].score == shown


def test_names_are_bounded_and_can_always_be_sent() -> None:
    item = read(YOLO, Thing(detections=[yolo(class_name="x" * 10_000, id="\ud800?")])).items[0]
    assert len(item.class_name) == 120
    assert item.track_id.encode("utf-8")


def test_detection2d_takes_the_likeliest_class() -> None:
    found = read(VISION_MSGS, Thing(detections=[detection2d(("cat", 0.2), ("dog", 0.7), ("?", math.nan))]))
    assert found.items[0] == Detection(0, "dog", 0.7, "", 1, 2, 3, 4)


@pytest.mark.parametrize(
    ("text", "class_id", "name"),
    [("17", 17, ""), ("person", 0, "person"), ("99999999999", 0, "99999999999"), ("²", 0, "²"), ("", 0, "")],
)
def test_detection2d_knows_numbers_from_words(text: str, class_id: int, name: str) -> None:
    item = read(VISION_MSGS, Thing(detections=[detection2d((text, 0.5))])).items[0]
    assert (item.class_id, item.class_name) == (class_id, name)


def test_detection2d_without_any_hypothesis_is_still_a_box() -> None:
    item = read(VISION_MSGS, Thing(detections=[detection2d()])).items[0]
    assert (item.class_name, item.score, item.width_px) == ("", 0.0, 3)


def test_a_battery_reports_percent() -> None:
    assert read(BATTERY, battery()) == Battery(True, 15.0, 50.0, False)


@pytest.mark.parametrize(
    ("share", "percent"),
    [
        (math.nan, None),
        (1.0, 100),
        (0.0, 0),
        (1.02, 100),
        (-0.01, 0),
        (57.0, None),
        (-1.0, None),
        (math.inf, None),
    ],
)
def test_a_charge_out_of_range_is_not_shown_as_full(share: float, percent: float | None) -> None:
    value = read(BATTERY, battery(percentage=share))
    assert value.charge_percent == percent
    assert value.charge_out_of_range == (percent is None and not math.isnan(share)), "NaN is unknown"


@pytest.mark.parametrize(
    ("status", "charging"), [(0, None), (1, True), (2, False), (3, False), (4, False), (9, None)]
)
def test_charging_is_known_only_where_the_battery_says_so(status: int, charging: bool | None) -> None:
    assert read(BATTERY, battery(status=status)).charging is charging


@pytest.mark.parametrize(
    ("percentage", "voltage", "there", "percent"),
    [
        (0.05, 15.0, True, 5.0),
        (0.0, 15.0, True, None),
        (0.0, 0.0, False, None),
        (math.nan, math.nan, False, None),
        (0.0, 0.9, False, None),
    ],
)
def test_a_battery_that_leaves_present_unset_is_there_if_it_has_a_voltage(
    percentage: float, voltage: float, there: bool, percent: float | None
) -> None:
    value = read(BATTERY, battery(percentage, voltage, present=False))
    assert (value.present, value.charge_percent, value.charge_out_of_range) == (there, percent, False)


def test_a_battery_that_has_sent_percent_is_never_nearly_full_when_it_is_nearly_empty() -> None:
    """From 57 down to 0.9, which is not 90 %."""
    board = Board()
    for at_s, sent in enumerate((57.0, 2.0, 1.2, 1.0, 0.9, math.nan)):
        board[specs.BATTERY] = Received(read(BATTERY, battery(sent)), float(at_s))
        shown = board[specs.BATTERY]
        assert shown is not None
        assert (shown.value.charge_percent, shown.value.charge_out_of_range) == (None, True)


def test_a_gauge_that_is_a_little_out_of_range_once_is_believed_again() -> None:
    board = Board()
    for at_s, (sent, percent) in enumerate(((1.2, None), (1.0, 100.0), (-1.0, None), (0.5, 50.0))):
        board[specs.BATTERY] = Received(read(BATTERY, battery(sent)), float(at_s))
        shown = board[specs.BATTERY]
        assert shown is not None
        assert shown.value.charge_percent == percent


def test_a_voltage_that_is_not_known_is_none() -> None:
    assert read(BATTERY, battery(voltage=math.nan)).voltage_v is None


@given(st.lists(st.floats(), min_size=3, max_size=3))
def test_no_odometry_value_is_ever_anything_but_finite(speeds: list[float]) -> None:
    found = read(ODOMETRY, odometry(*speeds))
    assert found is None or all(map(math.isfinite, (found.vx_mps, found.vy_mps, found.wz_rad_s)))


def twist(vx: float, vy: float, wz: float) -> Thing:
    return Thing(linear=Thing(x=vx, y=vy, z=9), angular=Thing(x=9, y=9, z=wz))


def test_a_command_is_read_with_and_without_a_stamp() -> None:
    assert read(COMMAND, Thing(twist=twist(0.5, -0.1, 0.25))) == Velocity(0.5, -0.1, 0.25)
    assert read(INPUT, twist(0.5, -0.1, 0.25)) == Velocity(0.5, -0.1, 0.25)


@pytest.mark.parametrize("place", range(3))
def test_a_command_that_is_no_number_is_none(place: int) -> None:
    speeds = [0.5, 0.1, 0.2]
    speeds[place] = math.nan
    assert read(INPUT, twist(*speeds)) is None


@pytest.mark.parametrize(
    ("level", "read_as"),
    [
        (b"\x00", DiagnosticLevel.OK),
        (b"\x01", DiagnosticLevel.WARNING),
        (b"\x02", DiagnosticLevel.ERROR),
        (b"\x03", DiagnosticLevel.STALE),
        (b"\x04", DiagnosticLevel.ERROR),
        (b"\xff", DiagnosticLevel.ERROR),
    ],
)
def test_diagnostics_report_a_level_for_each_component(level: bytes, read_as: DiagnosticLevel) -> None:
    found = read(DIAGNOSTICS, Thing(status=[Thing(name="drive", level=level, message="m")]))
    assert found.items == (DiagnosticItem("drive", read_as, "m"),)


def test_diagnostics_are_bounded() -> None:
    status = Thing(name="n" * 1000, level=b"\x00", message="m" * 1000)
    found = read(DIAGNOSTICS, Thing(status=[status] * 1000))
    assert len(found.items) == 256
    assert (len(found.items[0].component), len(found.items[0].message)) == (120, 300)


@pytest.mark.parametrize(
    ("text", "mode"),
    [
        ("exploring", Mode("exploring")),
        (" idle\n", Mode("idle")),
        ("", None),
        (" \n", None),
        ("a\x1b[2Jb\nc", Mode("a\ufffd[2Jb c")),
    ],
)
def test_a_mode_is_one_printable_line(text: str, mode: Mode | None) -> None:
    assert read(MODE, Thing(data=text)) == mode


def test_every_default_source_has_a_reader() -> None:
    assert all(callable(reader_for(settings)) for settings in DEFAULT_SOURCES)


def test_a_type_without_reader_is_refused_with_those_that_have_one() -> None:
    with pytest.raises(UserError, match=r"my_msgs/msg/Speed.*nav_msgs/msg/Odometry"):
        reader_for(source("odometry", "my_msgs/msg/Speed"))


def test_a_type_read_for_another_kind_is_refused() -> None:
    with pytest.raises(UserError, match="nav_msgs/msg/Odometry"):
        reader_for(source("battery", "nav_msgs/msg/Odometry"))


def test_two_readers_for_one_type_are_a_mistake() -> None:
    with pytest.raises(ValueError, match="two readers"):
        reads("nav_msgs/msg/Odometry", specs.ODOMETRY)(lambda *_: None)
