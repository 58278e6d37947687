"""Hosts that no program can serve at are mistakes of the configuration."""

from pathlib import Path

import pytest

from common.config import Settings, load
from gateway.config import GatewaySettings
from hub.receiver.config import ReceiverSettings
from tap.config import TapSettings
from tests.support.program_settings import file_with, refusal_of

HOSTS = [
    (GatewaySettings, ("grpc", "host")),
    (GatewaySettings, ("metrics", "host")),
    (TapSettings, ("metrics", "host")),
    (ReceiverSettings, ("metrics", "host")),
]


@pytest.mark.parametrize(("program", "keys"), HOSTS)
@pytest.mark.parametrize(
    "host",
    [
        "",
        "[::1]",
        "127.0.0.1:50051",
        "http://robot.local",
        "a b",
        "a\0b",
        "robot..local",
        ".local",
        "-a",
        "a-",
        "ä.local",
        "a" * 64,
        ".".join(["abcdefg"] * 32),
        "::g",
        "fe80::1%",
    ],
)
def test_what_is_no_host_is_refused(
    tmp_path: Path, program: type[Settings], keys: tuple[str, str], host: str
) -> None:
    what = refusal_of(program, keys, host, tmp_path / "x.yaml")
    assert f"key '{'.'.join(keys)}' is {host!r}, expected: " in what
    assert what.endswith("a host name or an address, 127.0.0.1 or ::1 for example")


@pytest.mark.parametrize(
    "host",
    [
        "127.0.0.1",
        "::",
        "::1",
        "fe80::1%eth0",
        "localhost",
        "robot",
        "lab_1.local",
        "r2-d2.a.",
        "1a",
    ],
)
def test_what_may_be_a_host_is_taken(tmp_path: Path, host: str) -> None:
    values = {"grpc": {"host": host}, "security": {"insecure": True}}
    assert load(GatewaySettings, file_with(GatewaySettings, values, tmp_path / "x.yaml")).grpc.host == host
