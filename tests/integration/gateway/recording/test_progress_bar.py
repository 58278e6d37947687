"""What an operator sees on a terminal while a recording is copied."""

import asyncio
import re
from pathlib import Path

from tests.support.robotctl import ENDS_WITHIN_S
from tests.support.running_gateway import running_gateway
from tests.support.served_recorder import served
from tests.support.terminal import robotctl_on_terminal

MB = 1_000_000
SIZE = 1 * MB
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
    done, rates_kb, _ = zip(*frames, strict=True)
    assert list(done) == sorted(done)
    assert min(rates_kb) < 1.1 * LIMIT_MBIT * 1000 / 8
    copying = [frame for frame in frames if frame[0] < SIZE / MB]
    # A stall may come between the parts of a frame.
    assert sum(fits(*frame) for frame in copying) > len(copying) / 2, copying
    assert left == [f"{tmp_path / 'to' / made.id}: 2 files, 1.0 MB, verified", ""], "and no bar any more"


def fits(done_mb: float, rate_kb: float, left_s: float) -> bool:
    """Whether the time left is what this rate takes for the rest; megabytes are shown with one decimal."""
    least_s, most_s = ((SIZE / MB - done_mb + error) * 1000 / rate_kb for error in (-0.1, 0.1))
    return least_s <= left_s <= most_s + 1


def copied(*words: str) -> tuple[str, list[str]]:
    """Everything that was drawn, and the lines that are left at the end."""
    with robotctl_on_terminal(*words, columns=250) as screen:
        screen.wait_for("verified")
        assert screen.process.wait(ENDS_WITHIN_S) == 0
        return screen.read(), screen.lines()
