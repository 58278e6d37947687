"""The schema's guard bites: what would break robots or tools in the field does not pass."""

import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
BUF = ROOT / ".venv/bin/buf"
LOCKED_IMAGE = ROOT / "proto/locked/gateway-v1.binpb"
V1 = Path("proto/omniseer/gateway/v1")


@pytest.fixture
def schema(tmp_path: Path) -> Path:
    """A copy of the schema that a test may damage."""
    for package in ("buf", "omniseer"):
        shutil.copytree(ROOT / "proto" / package, tmp_path / "proto" / package)
    shutil.copy(ROOT / "buf.yaml", tmp_path)
    return tmp_path


def breaking(schema: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [BUF, "breaking", "--against", LOCKED_IMAGE],
        cwd=schema,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def edit(schema: Path, file: str, old: str, new: str) -> None:
    path = schema / V1 / file
    text = path.read_text()
    assert text.count(old) == 1, f"{old!r} is there {text.count(old)} times"
    path.write_text(text.replace(old, new))


def test_the_schema_as_it_is_breaks_nothing(schema: Path) -> None:
    result = breaking(schema)
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
    edit(schema, file, old, new)

    result = breaking(schema)

    assert result.returncode != 0
    assert complaint in result.stdout


def test_an_addition_is_welcome(schema: Path) -> None:
    edit(
        schema,
        "system_status.proto",
        "EffectiveCommand effective_command = 8;",
        "EffectiveCommand effective_command = 8;\n  // New.\n  string new_field = 99;",
    )
    assert breaking(schema).returncode == 0


def test_style_rules_are_lifted_only_where_v1_is_locked() -> None:
    """Who adds to this list has to say so here, too."""
    lint = yaml.safe_load((ROOT / "buf.yaml").read_text())["lint"]
    assert lint["use"] == ["STANDARD"]
    assert lint["disallow_comment_ignores"] is True
    assert lint["ignore_only"] == {
        "ENUM_VALUE_PREFIX": [f"{V1}/states.proto"],
        "RPC_RESPONSE_STANDARD_NAME": [f"{V1}/robot_gateway.proto"],
        "SERVICE_SUFFIX": [f"{V1}/robot_gateway.proto"],
    }
    assert "except" not in lint
    assert lint["ignore"] == ["proto/buf"]


def test_generated_code_is_up_to_date() -> None:
    result = subprocess.run(
        ["scripts/generate", "--check"], cwd=ROOT, capture_output=True, text=True, timeout=60, check=False
    )
    assert result.returncode == 0, result.stdout + result.stderr
