"""The preview against the usual pipeline: same camera, same codec, in the same run.

Where "what" does not say "at once", each side is alone on the machine, and both in every round. Frames carry
the moment of their capture (stamp.py) from before the encoder to behind the decoder.
"""

import tempfile
from collections.abc import Collection
from pathlib import Path

from bench.catalogue import rows_of
from bench.rows import Row


def run(names: Collection[str]) -> list[Row]:
    # The camera's frames and its shared memory: in RAM where there is a place for it.
    in_ram = Path("/dev/shm")  # noqa: S108  # a new directory below it, mode 0700
    with tempfile.TemporaryDirectory(dir=in_ram if in_ram.is_dir() else None) as workdir:
        return rows_of(names, Path(workdir))
