"""`robot-bridge hub revoke`: whom it means."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from common.errors import ExitCode, UserError
from hub import administration
from hub.cli import app
from hub.directory import HubDirectory, Kind


def test_a_person_and_a_receiver_at_once_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The defect: the person was revoked; a receiver of that name, which may be stolen, was not."""
    revoked: list[tuple[Kind, str]] = []

    async def revoke(_directory: HubDirectory, kind: Kind, name: str) -> None:
        revoked.append((kind, name))

    monkeypatch.setattr(administration, "revoke", revoke)
    monkeypatch.setattr("hub.cli.refresh_nodes", lambda _hub: [])
    words = ("revoke", "anna", "--dir", str(tmp_path), "--operator")
    with pytest.raises(UserError, match="either a person or a receiver") as refused:
        CliRunner().invoke(app, (*words, "--receiver"), catch_exceptions=False)
    assert refused.value.exit_code is ExitCode.USAGE
    assert revoked == []
    CliRunner().invoke(app, words, catch_exceptions=False)
    assert revoked == [("operator", "anna")]
