"""Viewers that join a stream shortly after one another, in a process of their own.

Of their own, because SRT connections within one process hold each other up while they open and close.
"""

import json
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Final

from tests.support.mpegts import analyse
from tests.support.recording import record

ROOT: Final = Path(__file__).parents[2]
PATIENCE_S: Final = 60
STAYS_S: Final = 1.5


@dataclass(frozen=True)
class Seen:
    """What one viewer has got.

    Args:
        first_s: when its first bytes came, on `time.monotonic()`.
        key_frames: in the STAYS_S from then on.
    """

    first_s: float
    key_frames: int


def join(port: int, count: int, *, apart_s: float) -> list[Seen]:
    """Has so many viewers call, one every `apart_s` seconds; returns when they have left.

    Raises:
        subprocess.CalledProcessError: one of them got nothing.
    """
    command = [sys.executable, "-m", "tests.support.crowd", str(port), str(count), str(apart_s)]
    done = subprocess.run(command, cwd=ROOT, check=True, timeout=PATIENCE_S, stdout=subprocess.PIPE)
    return [Seen(**each) for each in json.loads(done.stdout)]


def main() -> None:
    port, count, apart_s = int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])
    begin_s = time.monotonic() + apart_s

    def watch(number: int) -> Seen:
        time.sleep(max(0.0, begin_s + number * apart_s - time.monotonic()))
        recording = record(port, STAYS_S)
        first_s = time.monotonic() - STAYS_S
        return Seen(first_s, sum(unit.key for unit in analyse(recording).access_units))

    with ThreadPoolExecutor(count) as crowd:
        json.dump([asdict(seen) for seen in crowd.map(watch, range(count))], sys.stdout)


if __name__ == "__main__":
    main()
