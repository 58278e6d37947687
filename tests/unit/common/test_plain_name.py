"""What is left of a robot's name."""

import pytest

from common.plain_name import plain_name


@pytest.mark.parametrize(
    ("name", "also", "plain"),
    [
        ("Lab 1", "", "Lab-1"),
        ("../../etc/passwd", "", "etc-passwd"),
        ("lab_1", "", "lab-1"),
        ("lab_1", "_", "lab_1"),
        ("__lab__", "_", "lab"),
        ("a--b", "", "a-b"),
        ("Grüße \x1b[2J", "", "Gr-e-2J"),
        ("", "", "robot"),
        ("///", "_", "robot"),
        ("abcdefghijk lm", "", "abcdefghijk"),
    ],
)
def test_letters_digits_and_hyphens_are_left(name: str, also: str, plain: str) -> None:
    assert plain_name(name, 12, also=also) == plain
