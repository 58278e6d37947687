import pytest

from common.addresses import bracketed, is_loopback


def test_only_ipv6_is_bracketed() -> None:
    assert [bracketed(host) for host in ("::1", "[::1]", "10.0.0.1", "robot")] == [
        "[::1]",
        "[::1]",
        "10.0.0.1",
        "robot",
    ]


@pytest.mark.parametrize(
    ("host", "expected"),
    [
        ("127.0.0.1", True),
        ("127.8.0.1", True),
        ("::1", True),
        ("[::1]", True),
        ("localhost", True),
        ("0.0.0.0", False),  # noqa: S104  # nothing is bound
        ("::", False),
        ("10.0.0.1", False),
        ("localhost.example", False),
        ("robot", False),
        ("", False),
    ],
)
def test_what_only_this_machine_reaches(host: str, expected: bool) -> None:
    assert is_loopback(host) is expected
