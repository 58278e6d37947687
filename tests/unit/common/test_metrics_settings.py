"""Metrics are unencrypted and open to all who reach them: beyond this machine only where that is accepted."""

from pathlib import Path

import pytest

from common.config import Settings, load
from common.errors import UserError
from gateway.config import GatewaySettings
from hub.receiver.config import ReceiverSettings
from tap.config import TapSettings

REQUIRED = """
fleet: lab
hub: {servers: ["nats://localhost:4222"]}
store: {bucket: lab, access_key: key, secret_key_file: /s}
signing_key: /k
"""
"""What a receiver's configuration has in any case."""
PROGRAMS = [(GatewaySettings, ""), (TapSettings, ""), (ReceiverSettings, REQUIRED)]


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "settings.yaml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(("settings_type", "required"), PROGRAMS)
@pytest.mark.parametrize("host", ["0.0.0.0", "10.0.0.1", "::", "robot"])  # noqa: S104  # nothing is bound
def test_others_read_them_only_where_that_is_accepted(
    settings_type: type[Settings], required: str, host: str, tmp_path: Path
) -> None:
    open_to_all = f"metrics:\n  port: 9464\n  host: '{host}'\n"
    with pytest.raises(UserError, match=f"line 3: metrics.host is {host}: anyone on that network") as seen:
        load(settings_type, written(tmp_path, open_to_all + required))
    assert "insecure: true" in str(seen.value)
    accepted = load(settings_type, written(tmp_path, open_to_all + "  insecure: true\n" + required))
    assert isinstance(accepted, (GatewaySettings, ReceiverSettings, TapSettings))
    assert accepted.metrics.host == host


@pytest.mark.parametrize(("settings_type", "required"), PROGRAMS)
@pytest.mark.parametrize("metrics", ["port: 9464", "{port: 0, host: localhost}", "host: 0.0.0.0"])
def test_on_this_machine_and_nowhere_they_need_nothing(
    settings_type: type[Settings], required: str, metrics: str, tmp_path: Path
) -> None:
    text = metrics if metrics.startswith("{") else f"{{{metrics}}}"
    load(settings_type, written(tmp_path, f"metrics: {text}\n{required}"))
