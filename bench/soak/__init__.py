"""Long runs: what the programs keep of what has ended, one by one and as a whole deployment."""

from collections.abc import Collection

from bench.catalogue import rows_of
from bench.rows import Row


def run(names: Collection[str]) -> list[Row]:
    return rows_of(names, None)
