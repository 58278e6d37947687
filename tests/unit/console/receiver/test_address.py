import pytest

from common.errors import ExitCode, UserError
from console.receiver.address import StreamAddress


def test_defaults_are_the_robots() -> None:
    address = StreamAddress("robot.local")
    assert (address.port, address.latency_ms, address.passphrase) == (7100, 125, "")


@pytest.mark.parametrize(
    ("host", "uri"), [("10.0.0.7", "srt://10.0.0.7:7100"), ("fe80::1", "srt://[fe80::1]:7100")]
)
def test_uri(host: str, uri: str) -> None:
    assert StreamAddress(host).uri == uri


def test_the_passphrase_shows_nowhere() -> None:
    address = StreamAddress("robot", passphrase="a secret thing")
    assert "secret" not in repr(address)
    assert "secret" not in str(address)
    assert "secret" not in address.uri


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"host": ""}, "host ''"),
        ({"host": "robot?mode=listener"}, "host 'robot?mode=listener'"),
        ({"port": 0}, "port 0"),
        ({"port": 65536}, "port 65536"),
        ({"latency_ms": -1}, "latency -1 ms"),
        ({"latency_ms": 10_001}, "latency 10001 ms"),
        ({"passphrase": "nine char"}, "passphrase has 9 characters"),
        ({"passphrase": "x" * 80}, "passphrase has 80 characters"),
    ],
)
def test_what_srt_cannot_use_is_refused(values: dict[str, object], text: str) -> None:
    with pytest.raises(UserError, match="stream ") as caught:
        StreamAddress(**({"host": "robot"} | values))  # type: ignore[arg-type]  # wrong values are the point
    assert text in caught.value.what
    assert caught.value.exit_code == ExitCode.USAGE


@pytest.mark.parametrize("length", [0, 10, 79])
def test_passphrases_srt_takes(length: int) -> None:
    assert len(StreamAddress("robot", passphrase="x" * length).passphrase) == length
