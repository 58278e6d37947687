"""What is missing in a recording of a minute: counted from the publisher's own numbers and the file's.

The publisher runs before and after the minute, so that discovery, in which nothing is promised, is left out.
"""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rec.ground import PRESET, Talker, between, taking_from, talker
from bench.rec.reading import missing, numbers
from bench.rows import FEWEST_ROUNDS, Row
from tests.support.running_recorder import RecorderProgram, recorder_program

ROUNDS: Final = FEWEST_ROUNDS
SECONDS: Final = 60.0
_AFTERWARDS_S: Final = 2.0
"""Until what was published last is in the file."""
_RATES_MB_S: Final = {"rec.lost_10": 10, "rec.lost_40": 40}


@dataclass(frozen=True, slots=True)
class Found:
    """Messages of one round.

    Attributes:
        published: by the talker.
        lost: of these, not in the recording.
        untaken: of the lost ones, those that came after the newest of their topic: the recorder was so late
            that they were still on their way when it was stopped.
        counted: lost by the recorder's own count, which begins before the round; None where it knows none.
    """

    published: int
    lost: int
    untaken: int
    counted: int | None


def rows(workdir: Path, wanted: set[str]) -> list[Row]:
    made = []
    with recorder_program(workdir, presets=PRESET) as recorder:
        for name, rate in _RATES_MB_S.items():
            if name not in wanted:
                continue
            rounds = []
            for _ in range(ROUNDS):
                with talker(rate) as publisher:
                    rounds.append(one_round(recorder, publisher, SECONDS))
                log(f"{name}: {rounds[-1]}")
            least = min(each.published for each in rounds)
            made.append(
                Row(
                    name=name,
                    what=f"messages missing in a recording, of at least {least} that were published: "
                    f"{rate} MB/s for {SECONDS:.0f} s",
                    unit="",
                    values=[float(each.lost) for each in rounds],
                    bar=0,
                    judged="worst",
                )
            )
    return made


def one_round(recorder: RecorderProgram, publisher: Talker, seconds: float) -> Found:
    """Records for so long, and counts."""
    with taking_from(recorder) as running:
        first = publisher.numbers()
        time.sleep(seconds)
        last = publisher.numbers()
        time.sleep(_AFTERWARDS_S)
        made = running.stop()
        found = numbers(running.folder)
        counted = made.messages_lost if made.HasField("messages_lost") else None
        untaken = missing({topic: set(range(max(each) + 1)) for topic, each in found.items()}, first, last)
        return Found(between(first, last), missing(found, first, last), untaken, counted)
