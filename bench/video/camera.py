"""A camera for benchmarks: footage with a stamp, 1280x720 NV12, offered through shared memory.

All senders read it by the same GStreamer description, so the way from the camera is the same for all. The
frames are made ahead by ffmpeg (a moving test pattern with noise as a sensor makes it), so that the camera
itself needs next to no CPU: it draws the stamp, writes it to its journal and hands the frame over.
"""

import subprocess
import sys
from array import array
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from bench.video import foreign

WIDTH_PX = 1280
HEIGHT_PX = 720
FRAME_BYTES = WIDTH_PX * HEIGHT_PX * 3 // 2
_FRAMES = 45


@dataclass(frozen=True, slots=True)
class Camera:
    """A camera that runs.

    Args:
        socket: where its shared memory is announced.
        journal: file with the capture times of all its frames.
        fps: frames per second.
    """

    socket: Path
    journal: Path
    fps: int

    @property
    def source(self) -> str:
        """GStreamer description that reads it and ends in raw video."""
        return f"shmsrc socket-path={self.socket} is-live=true do-timestamp=true ! {caps(self.fps)}"

    def captured(self, from_s: float, until_s: float) -> int:
        """Returns how many frames it took in a window of `time.monotonic()`."""
        content = self.journal.read_bytes()
        times_s = array("d")
        times_s.frombytes(content[: len(content) // times_s.itemsize * times_s.itemsize])
        return sum(from_s <= one < until_s for one in times_s)


@contextmanager
def camera(workdir: Path, fps: int = 30) -> Iterator[Camera]:
    """Runs a camera in a process of its own until the block ends.

    Raises:
        RuntimeError: it did not begin, or did not end when it was asked to.
    """
    footage = workdir / "footage.nv12"
    if not footage.exists():
        _make(footage)
    made = Camera(workdir / f"camera-{fps}", workdir / f"camera-{fps}.journal", fps)
    command = [sys.executable, "-m", "bench.video.camera_process"]
    command += [str(footage), str(made.socket), str(made.journal), str(fps)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        try:
            if process.stdout.readline().strip() != "ready":
                raise RuntimeError("the camera did not begin")
            yield made
        finally:
            foreign.end(process)
    if process.returncode:
        raise RuntimeError(f"the camera ended with exit code {process.returncode}")


def caps(fps: int) -> str:
    """Returns complete caps: shared memory has none, and no element downstream could fill a gap."""
    return (
        f"video/x-raw,format=NV12,width={WIDTH_PX},height={HEIGHT_PX},framerate={fps}/1"
        ",pixel-aspect-ratio=1/1,interlace-mode=progressive,colorimetry=bt709"
    )


def _make(footage: Path) -> None:
    pattern = f"testsrc2=size={WIDTH_PX}x{HEIGHT_PX}:rate=30,noise=alls=6:allf=t+u"
    command = ["ffmpeg", "-v", "error", "-f", "lavfi", "-i", pattern, "-frames:v", str(_FRAMES)]
    command += ["-pix_fmt", "nv12", "-f", "rawvideo", str(footage)]
    subprocess.run(command, env=foreign.environment(), check=True)
