"""Where the client library says what is wrong, robotctl names its options that mend it."""

from pathlib import Path

import pytest

from common.errors import ExitCode, UserError
from console.cli.export_options import naming_export_options
from console.cli.run import exit_code
from console.client.exporting import FolderTakenError


def test_a_robot_that_is_not_chosen(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for variable in ("ROBOTCTL_TARGET", "ROBOTCTL_ROBOT"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    (tmp_path / "robotctl").mkdir()
    (tmp_path / "robotctl/config.toml").write_text('[robots.lab1]\ntarget = "lab1.local"\n')
    monkeypatch.setattr("sys.argv", ["robotctl", "status"])
    assert exit_code() == ExitCode.USAGE
    assert capsys.readouterr().err == (
        "error: no robot is chosen, and none of lab1 is the default. "
        "Add --robot NAME, or type: robotctl robots default NAME\n"
    )


def test_a_folder_that_is_there_already() -> None:
    named = pytest.raises(UserError, match=r"^one is there already\. Go on .*\(--resume\), .* \(--to\)$")
    with named, naming_export_options():
        raise FolderTakenError("one is there already", "Resume it")
    with pytest.raises(UserError, match=r"^the disk is full$"), naming_export_options():
        raise UserError("the disk is full")
