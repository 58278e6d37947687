"""Definitions of installed types, as independent readers parse them."""

from pathlib import Path

import pytest
from mcap_ros2._dynamic import generate_dynamic
from rosbags.typesys import get_types_from_msg

from common.ros_node import TypeMissingError
from recorder.intake import schemas
from recorder.intake.schemas import Schemas

INSTALLED = [
    "std_msgs/msg/String",
    "nav_msgs/msg/Odometry",
    "sensor_msgs/msg/PointCloud2",
    "diagnostic_msgs/msg/DiagnosticArray",
    "nav_msgs/msg/OccupancyGrid",
    "rcl_interfaces/msg/ParameterEvent",
]


@pytest.mark.parametrize("type_name", INSTALLED)
def test_readers_know_every_type_that_a_definition_needs(type_name: str) -> None:
    schema = Schemas().of(type_name).decode()
    assert type_name in {
        name.replace("/", "/msg/", 1) for name in generate_dynamic(_short(type_name), schema)
    }
    assert type_name in get_types_from_msg(schema, type_name)


def _short(type_name: str) -> str:
    return type_name.replace("/msg/", "/")


def test_each_contained_type_is_there_once() -> None:
    lines = Schemas().of("nav_msgs/msg/Odometry").decode().splitlines()
    named = [line.removeprefix("MSG: ") for line in lines if line.startswith("MSG: ")]
    assert sorted(named) == sorted(
        [
            "std_msgs/Header",
            "builtin_interfaces/Time",
            "geometry_msgs/PoseWithCovariance",
            "geometry_msgs/Pose",
            "geometry_msgs/Point",
            "geometry_msgs/Quaternion",
            "geometry_msgs/TwistWithCovariance",
            "geometry_msgs/Twist",
            "geometry_msgs/Vector3",
        ]
    )


@pytest.mark.parametrize(
    "type_name",
    [
        "",
        "String",
        "std_msgs/String",
        "std_msgs/msg/../../secret",
        "../../etc/msg/Passwd",
        "os.path/msg/Name",
        "this/msg/Zen",
        "std_msgs/srv/String",
        "std_msgs/msg/NoSuchMessage",
        "no_such_package/msg/Name",
        "std_msgs/msg/String\n",
        "std_msgs/msg/" + "A" * 10_000,
    ],
)
def test_names_that_are_no_installed_type_are_refused(type_name: str) -> None:
    with pytest.raises(TypeMissingError):
        Schemas().of(type_name)


@pytest.mark.parametrize("content", [b"\xff\xfe", b"no_such_package/Thing thing\n", b"Missing[3] thing\n"])
def test_a_damaged_installation_is_an_error_for_people(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: bytes
) -> None:
    (tmp_path / "msg").mkdir()
    (tmp_path / "msg" / "Name.msg").write_bytes(content)
    monkeypatch.setattr(
        schemas, "share_directory", lambda package: tmp_path if package == "some_package" else None
    )
    with pytest.raises(TypeMissingError):
        Schemas().of("some_package/msg/Name")


def test_constants_comments_bounds_and_cycles_are_understood(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "msg").mkdir()
    (tmp_path / "msg" / "Name.msg").write_text(
        "# Other x\nuint8 KIND=1  # not Other y\nstring<=10[<=5] names\nfloat64[9] numbers\n"
        "Name[<=2] inner\nsome_package/Leaf[] leaves\nint32 count 7\n"
    )
    (tmp_path / "msg" / "Leaf.msg").write_text("bool ok\n")
    monkeypatch.setattr(schemas, "share_directory", lambda _package: tmp_path)
    schema = Schemas().of("some_package/msg/Name").decode()
    assert schema.count("MSG: ") == 1
    assert schema.endswith("=" * 80 + "\nMSG: some_package/Leaf\nbool ok\n")
