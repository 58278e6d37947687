"""robot-drive on the command line where there is no robot, and so nothing that a stall would end."""

from pathlib import Path

import pytest

from tests.integration.drive.test_commands import findings, robot_drive

pytestmark = [pytest.mark.ros, pytest.mark.usefixtures("ros_domain")]


def test_without_a_robot_the_doctor_says_what_is_missing(tmp_path: Path) -> None:
    done = robot_drive("doctor", "--json", DRIVE__SOCKET=str(tmp_path / "x.sock"))
    assert done.returncode == 1
    found = findings(done)
    assert found["drive"]["verdict"] == "note"
    assert found["mux/cmd_vel_keyboard"]["verdict"] == "wrong"
    assert found["base"]["verdict"] == "wrong"


def test_check_prints_what_is_in_effect(tmp_path: Path) -> None:
    file = tmp_path / "drive.yaml"
    file.write_text("limits: {vx_mps: 0.2}", encoding="utf-8")
    assert "vx_mps: 0.2\n" in robot_drive("check", "--config", str(file), "--print").stdout
    assert robot_drive("check", "--config", str(file), DRIVE__LIMITS__VX_MPS="fast").returncode == 2
    refused = robot_drive("serve", DRIVE__SOCKET="/nonexistent/x.sock")
    assert refused.returncode == 1
    assert "/nonexistent" in refused.stderr
    file.write_text("outputs: []", encoding="utf-8")
    refused = robot_drive("serve", "--config", str(file))
    assert refused.returncode == 2
    assert len(refused.stderr.strip().splitlines()) == 1
