"""Where the client library says what is wrong, robotctl names its options that mend it."""

from pathlib import Path

import grpc
import pytest

from common.errors import DomainError, ExitCode, TooMuchError, UserError
from common.grpc_errors import metadata_of
from common.reasons import Reason
from console.cli.error_report import error_as_json, report
from console.cli.export_options import naming_export_options
from console.cli.refusal_commands import COMMANDS
from console.cli.run import exit_code
from console.client import GatewayError
from console.client.error_table import error_from
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


@pytest.mark.parametrize("reason", COMMANDS)
def test_a_refusal_that_an_option_ends(
    reason: Reason, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    error = refused(TooMuchError("because", reason))
    assert error.remedy
    assert "robotctl" not in str(error), "it may be a script's, or a window's"
    monkeypatch.setattr("sys.argv", ["robotctl", "--robot", "lab1", "record"])
    report(error)
    printed, remedy = capsys.readouterr().err, error_as_json(error)["remedy"]
    assert printed == f"error: {error.what}. {remedy}\n"
    assert remedy == COMMANDS[reason].replace("robotctl ", "robotctl --robot lab1 ")


def test_a_refusal_that_no_option_ends_is_reported_as_it_is() -> None:
    error = refused(TooMuchError("because", Reason.NO_RING))
    assert error_as_json(error)["remedy"] == error.remedy


def refused(error: DomainError) -> GatewayError:
    """What the library makes of this error of a gateway."""
    code = grpc.StatusCode.FAILED_PRECONDITION
    details = grpc.aio.Metadata(*metadata_of(error, code))
    failure = grpc.aio.AioRpcError(code, grpc.aio.Metadata(), details, str(error))
    return error_from(failure, "robot:50051", 2.0)


def test_a_folder_that_is_there_already() -> None:
    named = pytest.raises(UserError, match=r"^one is there already\. Go on .*\(--resume\), .* \(--to\)$")
    with named, naming_export_options():
        raise FolderTakenError("one is there already", "Resume it")
    with pytest.raises(UserError, match=r"^the disk is full$"), naming_export_options():
        raise UserError("the disk is full")
