import pytest

from common.errors import ExitCode, UserError
from console.client import parse_target


@pytest.mark.parametrize(
    ("text", "target"),
    [
        ("robot.local", "robot.local:50051"),
        ("robot.local:1234", "robot.local:1234"),
        (" 10.0.0.7:50051 ", "10.0.0.7:50051"),
        ("[fe80::1]", "[fe80::1]:50051"),
        ("[fe80::1%eth0]:7", "[fe80::1%eth0]:7"),
    ],
)
def test_addresses_as_people_write_them(text: str, target: str) -> None:
    assert parse_target(text) == target


@pytest.mark.parametrize(
    "text", ["", ":50051", "a b", "robot:", "robot:0", "robot:65536", "robot:http", "http://robot", "fe80::1"]
)
def test_what_is_no_address_is_a_usage_error(text: str) -> None:
    with pytest.raises(UserError) as caught:
        parse_target(text)
    assert caught.value.exit_code is ExitCode.USAGE
    assert "robot.local:50051" in str(caught.value)
