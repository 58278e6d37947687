"""What a program draws is read as it comes, in pieces of any size."""

import os
from pathlib import Path

from tests.support.terminal import terminal_with


def test_a_character_may_come_in_two_pieces(tmp_path: Path) -> None:
    rest = tmp_path / "rest"
    os.mkfifo(rest)
    drawing = f"printf 'one \\342'; read _ < {rest}; printf '\\224\\201 two'"
    with terminal_with(["sh", "-c", drawing], typing=False) as screen:
        screen.wait_for("one ")
        rest.write_text("now\n", encoding="ascii")
        screen.wait_for("one \u2501 two")
