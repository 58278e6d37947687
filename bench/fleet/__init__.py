"""The fleet's hub: real nodes on this machine, with TLS and accounts, each message synced."""

import tempfile
from collections.abc import Collection
from pathlib import Path

from bench.catalogue import rows_of
from bench.rows import Row


def run(names: Collection[str]) -> list[Row]:
    with tempfile.TemporaryDirectory() as workdir:
        return rows_of(names, Path(workdir))
