"""The preview against today's usual pipeline: same camera, same codec, in turns.

Every round measures the reference, then ours, each alone on the machine; the median round speaks. Pictures
carry the moment of their capture (stamp.py) from before the encoder to behind the decoder.
"""

import tempfile
from collections.abc import Callable
from pathlib import Path

from bench.rows import Row
from bench.video import cpu, enabling, latency, switching

_BENCHES: dict[tuple[str, ...], Callable[[Path], list[Row]]] = {
    ("video.excess_latency_20",): lambda workdir: latency.rows(workdir, 20),
    ("video.excess_latency_125", "video.first_frame"): lambda workdir: latency.rows(workdir, 125),
    ("video.enable_to_frame_ms",): enabling.rows,
    ("video.cpu",): cpu.rows,
    ("video.switch_gap_ms",): switching.rows,
}


def run(names: list[str]) -> list[Row]:
    rows: list[Row] = []
    # The camera's pictures and its shared memory: in RAM where there is a place for it.
    with tempfile.TemporaryDirectory(dir="/dev/shm" if Path("/dev/shm").is_dir() else None) as workdir:
        for offered, bench in _BENCHES.items():
            if not names or set(names) & set(offered):
                rows += bench(Path(workdir))
    return [row for row in rows if not names or row.name in names]
