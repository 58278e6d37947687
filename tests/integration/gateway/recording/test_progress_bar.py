"""What an operator sees on a terminal while a recording is copied."""

import asyncio
import re
from pathlib import Path

from tests.support.robotctl import ENDS_WITHIN_S
from tests.support.running_gateway import running_gateway
from tests.support.served_recorder import served
from tests.support.terminal import robotctl_on_terminal

SIZE = 1_000_000
LIMIT_MBIT = 1
"""Copied in 8 s."""
COLOURS = re.compile(r"\x1b\[[\d;]*m")
BAR = re.compile(r"file \d of 2 \S+ ([\d.]+)/1\.0 MB ([\d.]+) kB/s 00:(\d\d)")
"""Done, rate, and seconds left."""


async def test_a_limited_copy_shows_its_rate_and_the_time_left(tmp_path: Path) -> None:
    recording = {"socket": tmp_path / "recorder.sock"}
    async with (
        served(tmp_path) as recorder,
        running_gateway(tmp_path / "preview.sock", recording=recording) as operator,
    ):
        made = await recorder.recorded(SIZE, 60)
        target = f"127.0.0.1:{operator.port}"
        words = ("record", "export", made.id, "--to", str(tmp_path / "to"), "--limit", str(LIMIT_MBIT))
        drawn, left = await asyncio.to_thread(copied, "--target", target, *words)
    frames = [tuple(map(float, each.groups())) for each in BAR.finditer(COLOURS.sub("", drawn))]
    done, rates_kb, left_s = zip(*frames, strict=True)
    assert list(done) == sorted(done)
    assert min(rates_kb) < 1.1 * LIMIT_MBIT * 1000 / 8
    assert left_s[0] >= left_s[-1]
    assert left == [f"{tmp_path / 'to' / made.id}: 2 files, 1.0 MB, verified", ""], "and no bar any more"


def copied(*words: str) -> tuple[str, list[str]]:
    """Everything that was drawn, and the lines that are left at the end."""
    with robotctl_on_terminal(*words, columns=250) as screen:
        screen.wait_for("verified")
        assert screen.process.wait(ENDS_WITHIN_S) == 0
        return screen.read(), screen.lines()
