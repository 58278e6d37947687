"""The schema guard refuses changes that would break programs in the field."""

import shutil
import subprocess
from importlib import import_module
from pathlib import Path

import pytest
import yaml
from google.protobuf.descriptor_pb2 import FileDescriptorSet

ROOT = Path(__file__).parents[2]
BUF = ROOT / ".venv/bin/buf"
LOCKED = ROOT / "proto/locked"
V1_IMAGE = LOCKED / "gateway-v1.binpb"
RELEASE_IMAGE = LOCKED / "0.1.0.binpb"
V1 = Path("proto/omniseer/gateway/v1")
PRIVATE = Path("proto/omniseer/preview/v1/preview_service.proto")


def test_what_is_added_to_a_message_of_the_locked_contract_starts_at_16() -> None:
    """The numbers below belong to that contract, used or not (proto/locked/README.md)."""
    added = []
    for file in FileDescriptorSet.FromString(V1_IMAGE.read_bytes()).file:
        module = import_module(f"{file.name.removesuffix('.proto').replace('/', '.')}_pb2")
        for locked in file.message_type:
            numbers = {field.number for field in locked.field}
            fields = module.DESCRIPTOR.message_types_by_name[locked.name].fields
            added += [each.full_name for each in fields if each.number < 16 and each.number not in numbers]
    assert added == []


@pytest.fixture
def schema(tmp_path: Path) -> Path:
    """A copy of the schema that a test may damage."""
    for package in ("buf", "omniseer"):
        shutil.copytree(ROOT / "proto" / package, tmp_path / "proto" / package)
    shutil.copy(ROOT / "buf.yaml", tmp_path)
    return tmp_path


def breaking(schema: Path, image: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [BUF, "breaking", "--against", image],
        cwd=schema,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def edit(schema: Path, file: Path, old: str, new: str) -> None:
    path = schema / file
    text = path.read_text()
    assert text.count(old) == 1, f"{old!r} occurs {text.count(old)} times in {file}"
    path.write_text(text.replace(old, new))


@pytest.mark.parametrize("image", sorted(LOCKED.glob("*.binpb")), ids=lambda image: image.stem)
def test_the_schema_as_it_is_breaks_nothing(schema: Path, image: Path) -> None:
    result = breaking(schema, image)
    assert result.returncode == 0, result.stdout


@pytest.mark.parametrize(
    ("file", "old", "new", "complaint"),
    [
        pytest.param(
            "system_status.proto",
            "float producer_fps = 3;",
            "float producer_fps = 17;",
            '"3" with name "producer_fps"',
            id="field renumbered",
        ),
        pytest.param(
            "system_status.proto",
            "uint64 odom_age_ms = 8;",
            "float odom_age_ms = 8;",
            "odom_age_ms",
            id="type changed",
        ),
        pytest.param(
            "system_status.proto",
            "float linear_speed_mps = 6;",
            "float speed_mps = 6;",
            "linear_speed_mps",
            id="field renamed",
        ),
        pytest.param(
            "overlay.proto",
            "repeated OverlayDetection detections = 7;",
            "OverlayDetection detections = 7;",
            "detections",
            id="repeated made single",
        ),
        pytest.param(
            "states.proto",
            "PREVIEW_RUNNING = 2;",
            "PREVIEW_RUNNING = 6;",
            '"2"',
            id="enum value renumbered",
        ),
        pytest.param(
            "robot_gateway.proto",
            "rpc GetOverlaySnapshot(GetOverlaySnapshotRequest) returns (OverlaySnapshot) {\n"
            "    option (required_role) = ROLE_VIEWER;\n"
            "  }",
            "",
            "GetOverlaySnapshot",
            id="method deleted",
        ),
        pytest.param(
            "robot_gateway.proto",
            "returns (SystemStatus)",
            "returns (OverlaySnapshot)",
            "GetSystemStatus",
            id="response type changed",
        ),
        pytest.param(
            "robot_gateway.proto",
            "service RobotGateway {",
            "service Gateway {",
            "RobotGateway",
            id="service renamed",
        ),
    ],
)
def test_a_breaking_change_is_refused(schema: Path, file: str, old: str, new: str, complaint: str) -> None:
    edit(schema, V1 / file, old, new)

    result = breaking(schema, V1_IMAGE)

    assert result.returncode != 0
    assert complaint in result.stdout


@pytest.mark.parametrize(
    ("file", "old", "new", "complaint"),
    [
        pytest.param(
            PRIVATE,
            "uint64 revision = 1;",
            "uint64 revision = 9;",
            '"revision"',
            id="private field renumbered",
        ),
        pytest.param(
            PRIVATE, "uint64 restarts = 2;", "float restarts = 2;", '"restarts"', id="private type changed"
        ),
        pytest.param(
            PRIVATE,
            "string instance_id = 1;",
            "reserved 1;",
            '"instance_id"',
            id="private field deleted, although its number is reserved",
        ),
        pytest.param(
            PRIVATE,
            "LIFECYCLE_STATE_STOPPING = 4;",
            "LIFECYCLE_STATE_ENDING = 4;",
            "LIFECYCLE_STATE_STOPPING",
            id="private enum value renamed",
        ),
        pytest.param(
            PRIVATE,
            "returns (stream WatchActualStateResponse)",
            "returns (WatchActualStateResponse)",
            "WatchActualState",
            id="private stream made a single response",
        ),
        pytest.param(
            PRIVATE,
            "rpc ListEncoders(ListEncodersRequest) returns (ListEncodersResponse);",
            "",
            "ListEncoders",
            id="private method deleted",
        ),
        pytest.param(
            V1 / "robot_gateway.proto",
            "rpc WatchSystemStatus(",
            "rpc FollowSystemStatus(",
            "WatchSystemStatus",
            id="method renamed that came after v1",
        ),
    ],
)
def test_a_release_can_not_be_broken(schema: Path, file: Path, old: str, new: str, complaint: str) -> None:
    edit(schema, file, old, new)

    result = breaking(schema, RELEASE_IMAGE)

    assert result.returncode != 0
    assert complaint in result.stdout


def test_a_released_file_can_not_be_renamed(schema: Path) -> None:
    (schema / PRIVATE).rename(schema / PRIVATE.with_stem("preview"))

    result = breaking(schema, RELEASE_IMAGE)

    assert result.returncode != 0
    assert PRIVATE.name in result.stdout


@pytest.mark.parametrize("image", sorted(LOCKED.glob("*.binpb")), ids=lambda image: image.stem)
def test_an_addition_is_welcome(schema: Path, image: Path) -> None:
    edit(
        schema,
        V1 / "system_status.proto",
        "EffectiveCommand effective_command = 8;",
        "EffectiveCommand effective_command = 8;\n  // New.\n  string new_field = 99;",
    )
    edit(
        schema, PRIVATE, "uint64 fallbacks = 4;", "uint64 fallbacks = 4;\n  // New.\n  uint64 new_field = 99;"
    )
    assert breaking(schema, image).returncode == 0


@pytest.fixture
def repository(schema: Path) -> Path:
    """The schema with everything that checking and freezing it needs, in a repository of its own."""
    shutil.copytree(LOCKED, schema / "proto/locked")
    shutil.copytree(ROOT / "proto/python", schema / "proto/python")
    shutil.copy(ROOT / "pyproject.toml", schema)
    (schema / "scripts").mkdir()
    for script in ("check-schema", "freeze-schema", "generate"):
        shutil.copy(ROOT / "scripts" / script, schema / "scripts")
    (schema / ".venv").symlink_to(ROOT / ".venv")
    author = ("-c", "user.name=test", "-c", "user.email=test@example.invalid")
    for command in (["init"], ["add", "."], [*author, "commit", "-m", "schema"]):
        subprocess.run(["git", *command], cwd=schema, check=True, capture_output=True, timeout=30)
    return schema


def freeze(repository: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["scripts/freeze-schema"], cwd=repository, capture_output=True, text=True, timeout=60, check=False
    )


def test_a_release_freezes_every_package_once(repository: Path) -> None:
    edit(repository, Path("pyproject.toml"), 'version = "0.1.0"', 'version = "9.8.7"')
    image = repository / "proto/locked/9.8.7.binpb"

    first = freeze(repository)
    frozen = image.read_bytes()
    again = freeze(repository)

    assert first.returncode == 0, first.stderr
    assert image.name in first.stderr
    for file in (repository / "proto/omniseer").rglob("*.proto"):
        assert str(file.relative_to(repository / "proto")).encode() in frozen
    assert again.returncode == 1
    assert "a released schema never changes" in again.stderr
    assert image.read_bytes() == frozen


def test_a_schema_that_breaks_a_release_is_not_frozen(repository: Path) -> None:
    edit(repository, Path("pyproject.toml"), 'version = "0.1.0"', 'version = "9.8.7"')
    edit(repository, PRIVATE, "uint64 restarts = 2;", "uint64 restarts = 99;")

    result = freeze(repository)

    assert result.returncode == 1
    assert "0.1.0.binpb" in result.stderr
    assert not (repository / "proto/locked/9.8.7.binpb").exists()


def test_style_rules_are_lifted_only_where_a_reason_is_given() -> None:
    """An exception added to buf.yaml must be listed here as well."""
    lint = yaml.safe_load((ROOT / "buf.yaml").read_text())["lint"]
    assert lint["use"] == ["STANDARD"]
    assert lint["disallow_comment_ignores"] is True
    assert lint["ignore_only"] == {
        "ENUM_VALUE_PREFIX": [f"{V1}/states.proto"],
        "RPC_RESPONSE_STANDARD_NAME": [f"{V1}/robot_gateway.proto"],
        "SERVICE_SUFFIX": [f"{V1}/robot_gateway.proto"],
        # The gateway passes calls on to the recorder with the same messages.
        "RPC_REQUEST_RESPONSE_UNIQUE": [
            f"{V1}/recording.proto",
            "proto/omniseer/recorder/v1/recorder_service.proto",
        ],
    }
    assert "except" not in lint
    assert lint["ignore"] == ["proto/buf"]


def test_generated_code_is_up_to_date() -> None:
    result = subprocess.run(
        ["scripts/generate", "--check"], cwd=ROOT, capture_output=True, text=True, timeout=60, check=False
    )
    assert result.returncode == 0, result.stdout + result.stderr
