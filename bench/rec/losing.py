"""What is missing in a recording of a minute, and whether the recorder has counted it.

Counted from the publisher's own numbers and the file's. The publisher runs before and after the minute, so
that discovery, in which nothing is promised, is left out. A recorder that keeps up has nothing to count: so
one that is frozen for some seconds is measured, too.
"""

import signal
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rec.ground import PRESET, Talker, between, taking_from, talker
from bench.rec.reading import gaps, missing, numbers
from bench.rows import FEWEST_ROUNDS, MeasurementError, Row
from tests.support.running_recorder import RecorderProgram, recorder_program

ROUNDS: Final = FEWEST_ROUNDS
SECONDS: Final = 60.0
_AFTERWARDS_S: Final = 2.0
"""Until what was published last is in the file."""
STALLED: Final = "rec.lost_stalled_miscounted"
STALLED_MB_S: Final = 10
STALLED_ROUND_S: Final = 12.0
FROZEN_S: Final = 4.0
_RATES_MB_S: Final = {"rec.lost_10": 10, "rec.lost_40": 40}


@dataclass(frozen=True, slots=True)
class Found:
    """Messages of one round.

    Attributes:
        published: by the talker.
        lost: of these, not in the recording.
        untaken: of the lost ones, those that came after the newest of their topic: the recorder was so late
            that they were still on their way when it was stopped.
        gaps: messages between others that are not in the recording, from its own begin to its end.
        counted: lost by the recorder's own count, from begin to end; None where it does not know.
    """

    published: int
    lost: int
    untaken: int
    gaps: int
    counted: int | None

    @property
    def miscounted(self) -> int:
        """How far the recorder's count is off; what it does not know it has not counted."""
        return abs(self.gaps - (self.counted or 0))


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    made = []
    with recorder_program(workdir, presets=PRESET) as recorder:
        for name, rate in _RATES_MB_S.items():
            if not wanted & {name, f"{name}_miscounted"}:
                continue
            rounds = []
            for _ in range(ROUNDS):
                with talker(rate) as publisher:
                    rounds.append(one_round(recorder, publisher, SECONDS))
                log(f"{name}: {rounds[-1]}")
            made += _rows(name, rate, rounds)
        if STALLED in wanted:
            made.append(_stalled_row(recorder))
    return [row for row in made if row.name in wanted]


def _rows(name: str, rate_mb_s: int, rounds: list[Found]) -> list[Row]:
    least = min(each.published for each in rounds)
    return [
        Row(
            name=name,
            what=f"messages missing in a recording, of at least {least} that were published: "
            f"{rate_mb_s} MB/s for {SECONDS:.0f} s",
            unit="",
            values=[float(each.lost) for each in rounds],
            bar=0,
            judged="worst",
        ),
        Row(
            name=f"{name}_miscounted",
            what="the same recordings: by how much the recorder's own count of lost messages is off",
            unit="",
            values=[float(each.miscounted) for each in rounds],
            bar=0,
            judged="worst",
        ),
    ]


def _stalled_row(recorder: RecorderProgram) -> Row:
    rounds = []
    for _ in range(ROUNDS):
        with talker(STALLED_MB_S) as publisher:
            rounds.append(one_round(recorder, publisher, STALLED_ROUND_S, frozen_s=FROZEN_S))
        log(f"{STALLED}: {rounds[-1]}")
        if not rounds[-1].gaps:
            raise MeasurementError(f"{STALLED}: nothing was lost, so nothing was counted")
    least = min(each.gaps for each in rounds)
    return Row(
        name=STALLED,
        what=f"recorder frozen for {FROZEN_S:g} s, at least {least} messages lost: by how much its own count"
        " is off",
        unit="",
        values=[float(each.miscounted) for each in rounds],
        bar=0,
        judged="worst",
    )


def one_round(
    recorder: RecorderProgram, publisher: Talker, seconds: float, *, frozen_s: float = 0.0
) -> Found:
    """Records for so long, and counts.

    Args:
        recorder: the program.
        publisher: of the messages.
        seconds: length of the round.
        frozen_s: how long the recorder stands still, in the middle.
    """
    with taking_from(recorder) as running:
        first = publisher.numbers()
        time.sleep((seconds - frozen_s) / 2)
        if frozen_s:
            _freeze(recorder, frozen_s)
        time.sleep((seconds - frozen_s) / 2)
        last = publisher.numbers()
        time.sleep(_AFTERWARDS_S)
        made = running.stop()
        found = numbers(running.folder)
        counted = made.messages_lost if made.HasField("messages_lost") else None
        untaken = missing({topic: set(range(max(each) + 1)) for topic, each in found.items()}, first, last)
        lost = missing(found, first, last)
        return Found(between(first, last), lost, untaken, gaps(found), counted)


def _freeze(recorder: RecorderProgram, seconds: float) -> None:
    assert recorder.process
    recorder.process.send_signal(signal.SIGSTOP)
    try:
        time.sleep(seconds)
    finally:
        recorder.process.send_signal(signal.SIGCONT)
