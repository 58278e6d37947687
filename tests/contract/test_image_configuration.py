"""Commands typed in a container (`docker compose exec`) read the configuration of its program."""

import re
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from bridge.cli import app as bridge_app
from drive.cli import app as drive_app
from gateway.cli import app as gateway_app
from preview.cli import app as preview_app
from recorder.cli import app as recorder_app
from tap.cli import app as tap_app

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("program", ["gateway", "preview", "drive", "recorder", "bridge"])
def test_the_images_name_the_file_once(program: str) -> None:
    file = program if program in ("preview", "bridge") else "gateway"
    dockerfile = (ROOT / f"docker/{file}.Dockerfile").read_text(encoding="utf-8")
    served = re.search(rf'"robot-{program}", "serve", "--config", "([^"]+)"', dockerfile)
    named = re.search(rf"ROBOT_{program.upper()}_CONFIG=(\S+)", dockerfile)
    assert served
    assert named
    assert named[1] == served[1]


def test_the_tap_names_the_file_once() -> None:
    """It runs in the gateway's image: compose.yaml says what the images of the others do."""
    services = yaml.safe_load((ROOT / "compose.yaml").read_text(encoding="utf-8"))["services"]
    for name, command in (("tap", "serve"), ("tap-config", "check")):
        service = services[name]
        assert service["image"].startswith("robot-gateway:")
        file = service["environment"]["ROBOT_TAP_CONFIG"]
        assert service["command"][-4:] == ["robot-tap", command, "--config", file]
        assert file in [each["target"] for each in service["volumes"] if isinstance(each, dict)]
    page = (ROOT / "docs/configuration.md").read_text(encoding="utf-8")
    assert "The images set them, compose.yaml that of the tap" in page


def test_the_variables_name_the_file(tmp_path: Path) -> None:
    file = tmp_path / "x.yaml"
    file.write_text("log_level: debug", encoding="utf-8")
    for app, variable in (
        (gateway_app, "ROBOT_GATEWAY_CONFIG"),
        (preview_app, "ROBOT_PREVIEW_CONFIG"),
        (drive_app, "ROBOT_DRIVE_CONFIG"),
        (recorder_app, "ROBOT_RECORDER_CONFIG"),
        (bridge_app, "ROBOT_BRIDGE_CONFIG"),
        (tap_app, "ROBOT_TAP_CONFIG"),
    ):
        shown = CliRunner().invoke(app, ["check", "--print"], env={variable: str(file)})
        assert shown.exit_code == 0, shown.output
        assert "log_level: debug\n" in shown.output


def test_check_refuses_a_kind_with_a_type_that_has_no_reader(tmp_path: Path) -> None:
    file = tmp_path / "x.yaml"
    file.write_text(
        "sources:\n- kind: odometry\n  topic: /odom\n  type: geometry_msgs/msg/Twist\n", encoding="utf-8"
    )
    refused = CliRunner().invoke(gateway_app, ["check", "--config", str(file)])
    assert refused.exit_code != 0
    assert ", line 4: source 'odometry' (/odom) has type " in str(refused.exception)
    assert "no reader supports" in str(refused.exception)
