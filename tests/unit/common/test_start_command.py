"""Doctors and faults name the commands that start a program on this machine, or give it messages."""

from pathlib import Path

import pytest

from common import start_command as start_commands
from common.start_command import messages_remedy, start_command
from gateway.doctor.endpoints import RECORDER, service_endpoint

ROOT = Path(__file__).parents[3]


def test_by_hand_it_is_the_program_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROBOT_GATEWAY_START", raising=False)
    assert start_command("robot-drive") == "robot-drive serve"


def test_where_a_supervisor_starts_it_it_is_the_supervisors(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("ROBOT_GATEWAY_START", "sudo systemctl restart")
    finding = service_endpoint(RECORDER, tmp_path / "recorder.sock")
    assert finding.remedy == "Start the recorder: sudo systemctl restart robot-recorder"


@pytest.mark.parametrize(
    ("supervisor", "image", "begins", "command"),
    [
        ("", False, "Source the setup.bash of the workspace", "and type: robot-gateway serve"),
        (
            "sudo systemctl restart",
            False,
            "Type: sudo scripts/install-robot --ros-setup /opt/robot-workspace/setup.bash",
            "&& sudo systemctl restart robot-gateway",
        ),
        (
            "",
            True,
            "In the directory of compose.yaml, type: scripts/images build --ros packages",
            "&& docker compose up -d gateway",
        ),
    ],
)
def test_the_robots_messages_come_from_where_the_gateway_has_its_own(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    *,
    supervisor: str,
    image: bool,
    begins: str,
    command: str,
) -> None:
    """The defect: a robot without Docker was given the command that builds images."""
    monkeypatch.setenv("ROBOT_GATEWAY_START", supervisor)
    packages = tmp_path / "packages.txt"
    if image:
        packages.touch()
    monkeypatch.setattr(start_commands, "_OF_IMAGE", packages)
    remedy = messages_remedy()
    assert remedy.startswith(begins)
    assert command in remedy


def test_the_images_have_what_they_are_known_by() -> None:
    assert f"> {start_commands._OF_IMAGE}\n" in (ROOT / "docker/gateway.Dockerfile").read_text()
