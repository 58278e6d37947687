"""Viewers that come and go, several at a time, in a process of their own: `visit(port, 200)`.

Of their own, because SRT connections within one process hold each other up while they open and close.
"""

import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

from tests.support.recording import record

ROOT: Final = Path(__file__).parents[2]
AT_A_TIME: Final = 8
PATIENCE_S: Final = 60


def visit(port: int, count: int) -> None:
    """Has so many connect and leave with the first bytes they get.

    Raises:
        subprocess.CalledProcessError: one of them got nothing.
    """
    command = [sys.executable, "-m", "tests.support.visitors", str(port), str(count)]
    subprocess.run(command, cwd=ROOT, check=True, timeout=PATIENCE_S)


def main() -> None:
    port, count = int(sys.argv[1]), int(sys.argv[2])
    with ThreadPoolExecutor(AT_A_TIME) as crowd:
        # An exception of any of them ends the program.
        list(crowd.map(lambda _: record(port, 0.0), range(count)))


if __name__ == "__main__":
    main()
