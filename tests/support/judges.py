"""Debian's ffmpeg and ffprobe as independent judges of a stream."""

import json
import subprocess
from pathlib import Path
from typing import Any

from bench.video import stamp
from bench.video.foreign import environment


def complaints(recording: Path) -> str:
    """What ffmpeg says while it decodes every frame; empty when it has nothing to say."""
    command = ["ffmpeg", "-v", "warning", "-xerror", "-err_detect", "explode", "-i", str(recording)]
    return _run(*command, "-f", "null", "-").stderr.strip()


def decoded_frames(recording: Path) -> int:
    """How many frames ffprobe decodes."""
    entries = "stream=nb_read_frames"
    command = ["ffprobe", "-v", "error", "-count_frames", "-select_streams", "v:0", "-show_entries", entries]
    found: dict[str, Any] = json.loads(_run(*command, "-of", "json", str(recording)).stdout)
    return int(found["streams"][0]["nb_read_frames"])


def stamps(recording: Path) -> list[float | None]:
    """The stamp of each decoded frame, as bench.video.stamp reads it."""
    row = f"format=gray,crop={stamp.WIDTH_PX}:1:0:{stamp.BLOCK_PX // 2}"
    command = ["ffmpeg", "-v", "error", "-i", str(recording), "-vf", row, "-fps_mode", "passthrough"]
    done = subprocess.run(
        [*command, "-f", "rawvideo", "-"], env=environment(), capture_output=True, check=True
    )
    rows = range(0, len(done.stdout), stamp.WIDTH_PX)
    return [stamp.read(done.stdout[at : at + stamp.WIDTH_PX]) for at in rows]


def _run(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, env=environment(), capture_output=True, text=True, timeout=60, check=False)
