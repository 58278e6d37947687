"""Debian's ffmpeg and ffprobe as independent judges of a stream."""

import json
import os
import subprocess
from pathlib import Path
from typing import Any


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


def _run(*command: str) -> subprocess.CompletedProcess[str]:
    # The libraries of the ROS wheels don't concern foreign programs.
    environment = {name: value for name, value in os.environ.items() if name != "LD_LIBRARY_PATH"}
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)
