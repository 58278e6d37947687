"""How fast a segment that a killed recorder has left is made whole; beside it, how fast it is only hashed."""

import hashlib
import os
import shutil
import time
from pathlib import Path
from typing import Final

from bench.progress import log
from bench.rec.talker import IMAGE_BYTES, IMAGE_HZ, ODOMETRIES, ODOMETRY_HZ
from bench.rows import FEWEST_ROUNDS, Row
from recorder.mcap.recovery import recover
from recorder.mcap.writer import SegmentWriter
from recorder.values import Channel, Sample
from recorder.writing.writer import FLUSH_S

ROUNDS: Final = FEWEST_ROUNDS
SIZE: Final = 64 * 1024 * 1024
"""Of a segment at most, as configured by default."""
BAR_MIB_S: Final = 200
_MIB: Final = 1024 * 1024
_ODOMETRY_BYTES: Final = 720


def rows(workdir: Path, _wanted: set[str]) -> list[Row]:
    left = unfinished(workdir, SIZE)
    recovered, hashed = [], []
    recovered_mib_s(left, workdir)  # code and file get into memory
    for number in range(ROUNDS):
        recovered.append(recovered_mib_s(left, workdir))
        hashed.append(hashed_mib_s(left))
        log(f"rec.recovery_mib_s: round {number + 1}, {recovered[-1]:.0f}, SHA-256 alone {hashed[-1]:.0f}")
    return [
        Row(
            name="rec.recovery_mib_s",
            what=f"recovery of a segment of {SIZE // _MIB} MiB, synced (SHA-256 alone:"
            f" {sorted(hashed)[ROUNDS // 2]:.0f} MiB/s)",
            unit="MiB/s",
            values=recovered,
            bar=BAR_MIB_S,
            better="higher",
        )
    ]


def unfinished(directory: Path, size: int) -> Path:
    """Writes a segment of the talker's messages as a killed recorder leaves it."""
    path = directory / "000000.mcap.part"
    writer = SegmentWriter(path)
    odometry = [
        _channel(f"/bench/odometry_{number}", "nav_msgs/msg/Odometry") for number in range(ODOMETRIES)
    ]
    image = _channel("/bench/image_0", "sensor_msgs/msg/CompressedImage")
    period_ns = 1_000_000_000 // ODOMETRY_HZ
    count = 0
    while writer.size < size:
        count += 1
        at_ns = count * period_ns
        for each in odometry:
            # As odometry does, half of it compresses.
            data = os.urandom(_ODOMETRY_BYTES // 2) + bytes(_ODOMETRY_BYTES // 2)
            writer.write(Sample(each, data, at_ns, at_ns, count, at_ns))
        if count % (ODOMETRY_HZ // IMAGE_HZ) == 0:
            writer.write(Sample(image, os.urandom(IMAGE_BYTES), at_ns, at_ns, count, at_ns))
        if count % int(ODOMETRY_HZ * FLUSH_S) == 0:
            writer.flush()
    writer.flush()
    writer.abandon()
    return path


def recovered_mib_s(left: Path, workdir: Path) -> float:
    """Recovers a copy of a segment; returns its MiB a second.

    Raises:
        RuntimeError: it was not recovered.
    """
    folder = workdir / "copy"
    folder.mkdir()
    try:
        part = folder / left.name
        shutil.copyfile(left, part)
        os.sync()  # the copy's own bytes are no part of what the recovery syncs
        began_s = time.perf_counter()
        summary = recover(part)
        passed_s = time.perf_counter() - began_s
        if summary is None:
            raise RuntimeError("nothing was recovered")
        return summary.size / _MIB / passed_s
    finally:
        shutil.rmtree(folder)


def hashed_mib_s(path: Path) -> float:
    """Returns how many MiB a second of a file are read and hashed."""
    began_s = time.perf_counter()
    with path.open("rb") as file:
        hashlib.file_digest(file, "sha256")
    return path.stat().st_size / _MIB / (time.perf_counter() - began_s)


def _channel(topic: str, type_name: str) -> Channel:
    return Channel(topic, type_name, b"float64 x\n", "ros2msg", "", latched=False, presets=frozenset())
