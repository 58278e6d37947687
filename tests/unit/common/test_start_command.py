"""Doctors name the command that starts a program on this machine."""

from pathlib import Path

import pytest

from common.start_command import start_command
from gateway.doctor.endpoints import RECORDER, service_endpoint


def test_by_hand_it_is_the_program_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROBOT_GATEWAY_START", raising=False)
    assert start_command("robot-drive") == "robot-drive serve"


def test_where_a_supervisor_starts_it_it_is_the_supervisors(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("ROBOT_GATEWAY_START", "sudo systemctl restart")
    finding = service_endpoint(RECORDER, tmp_path / "recorder.sock")
    assert finding.remedy == "Start the recorder: sudo systemctl restart robot-recorder"
