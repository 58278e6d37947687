"""`robot-bridge hub exporter`: who can read the fleet's metrics."""

import pytest
from typer.testing import CliRunner

from common.errors import ExitCode, UserError
from fleet.connection import FleetAddress
from hub.cli import app
from hub.exporter import app as exporter_app

SERVERS = ("--servers", "nats://127.0.0.1:4222")


@pytest.fixture
def served(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, int]]:
    """Where the metrics would be served."""
    places: list[tuple[str, int]] = []

    async def export(_address: FleetAddress, host: str, port: int) -> None:
        places.append((host, port))

    monkeypatch.setattr(exporter_app, "export_until_stopped", export)
    return places


def run(*words: str) -> None:
    CliRunner().invoke(app, ("exporter", *SERVERS, *words), catch_exceptions=False)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.0.2.7", "hub.example"])  # noqa: S104
def test_other_machines_read_the_metrics_only_by_permission(host: str, served: list[tuple[str, int]]) -> None:
    with pytest.raises(UserError, match=f"--host is {host}: anyone on that network") as refused:
        run("--host", host)
    assert refused.value.exit_code is ExitCode.USAGE
    assert "--insecure" in (refused.value.remedy or "")
    assert served == []
    run("--host", host, "--insecure")
    assert served == [(host, 9109)]


@pytest.mark.parametrize("words", [(), ("--host", "::1"), ("--host", "localhost")])
def test_this_machine_needs_none(words: tuple[str, ...], served: list[tuple[str, int]]) -> None:
    run(*words)
    assert len(served) == 1
