"""The settings of all programs that read a YAML file, and what is said of a wrong value in one."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import pytest

from bridge.config import BridgeSettings
from common.config import Settings, load
from common.errors import ExitCode, UserError
from drive.config import DriveSettings
from gateway.config import GatewaySettings
from hub.receiver.config import ReceiverSettings
from preview.config import PreviewSettings
from recorder.config import RecorderSettings
from tap.config import TapSettings

PROGRAMS: Final[tuple[type[Settings], ...]] = (
    GatewaySettings,
    PreviewSettings,
    RecorderSettings,
    DriveSettings,
    BridgeSettings,
    ReceiverSettings,
    TapSettings,
)

NEEDED: Final[Mapping[type[Settings], Mapping[str, Any]]] = {
    ReceiverSettings: {
        "fleet": "f",
        "hub": {"servers": ["nats://127.0.0.1"]},
        "store": {"bucket": "b-1", "access_key": "k", "secret_key_file": "/s"},
        "signing_key": "/k",
    }
}
"""What a file of a program must have."""


def file_with(settings_type: type[Settings], values: Mapping[str, Any], file: Path) -> Path:
    """Writes a file with these values and those that the program needs."""
    file.write_text(json.dumps({**NEEDED.get(settings_type, {}), **values}), encoding="utf-8")
    return file


def refusal_of(settings_type: type[Settings], keys: tuple[str, ...], value: Any, file: Path) -> str:
    """What a program says of a file with this value, which it must refuse."""
    values: Any = value
    for key in reversed(keys):
        values = {key: values}
    with pytest.raises(UserError) as raised:
        load(settings_type, file_with(settings_type, values, file))
    assert raised.value.exit_code is ExitCode.USAGE
    return raised.value.what
