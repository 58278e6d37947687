"""Measures rows of one part: `python -m bench.measure FILE NAME...` writes them to FILE (see running.py)."""

import importlib
import sys
from pathlib import Path

from bench.results import write_rows


def main() -> None:
    file, *names = sys.argv[1:]
    group = names[0].partition(".")[0]
    write_rows(importlib.import_module(f"bench.{group}").run(names), Path(file))


if __name__ == "__main__":
    main()
