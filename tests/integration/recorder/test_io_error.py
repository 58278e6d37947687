"""A disk that breaks under a recorder: the kernel's own I/O error (EIO), of a real block device."""

import fcntl
import os
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from common.errors import PreconditionError
from recorder.recording.requests import StartOptions
from recorder.store.manifest import RecordingState, StopReason
from tests.support.recorder_in_process import Source, running_recorder

MIB = 1024 * 1024
SIZE = 64 * MIB


@dataclass
class BrittleDisk:
    """An ext4 file system on a loop device, whose medium is a file in memory.

    Attributes:
        path: where it is mounted.
    """

    path: Path
    medium: int

    def break_down(self) -> None:
        """Takes the medium away, so that each block that is written is an I/O error from now on.

        The file is cut off and may not grow again (F_SEAL_GROW, fcntl(2)): the loop device's writes fail with
        EPERM, which the block layer reports as EIO. Running out of space would be ENOSPC.
        """
        os.ftruncate(self.medium, 0)
        fcntl.fcntl(self.medium, fcntl.F_ADD_SEALS, fcntl.F_SEAL_GROW)


@pytest.fixture
def brittle_disk(tmp_path: Path) -> Iterator[BrittleDisk]:
    disk = tmp_path / "disk"
    disk.mkdir()
    medium = os.memfd_create("disk", os.MFD_ALLOW_SEALING | os.MFD_CLOEXEC)
    try:
        os.ftruncate(medium, SIZE)
        device = f"/proc/{os.getpid()}/fd/{medium}"
        for words in (
            ["mke2fs", "-q", "-F", "-t", "ext4", device],
            ["mount", "-o", "loop,errors=continue", device, str(disk)],
        ):
            if subprocess.run(words, capture_output=True, check=False).returncode:
                pytest.skip("this user can't mount a file system on a loop device")
        try:
            yield BrittleDisk(disk, medium)
        finally:
            # The loop device goes with its last user.
            subprocess.run(["umount", "--lazy", str(disk)], check=True)
    finally:
        os.close(medium)


async def test_an_io_error_ends_the_recording_and_refuses_another_one(brittle_disk: BrittleDisk) -> None:
    async with running_recorder(brittle_disk.path / "root") as running:
        await running.operations.start("1", StartOptions())
        source = Source(running.queue)
        source.send(100, size=1000)
        await running.written(100)
        brittle_disk.break_down()
        source.send(100, size=20_000)
        await running.until(lambda: running.status_reader.running is None)
        cut = running.status_reader.newest
        assert cut
        assert (cut.state, cut.stop_reason) == (RecordingState.FAULTED, StopReason.ERROR)
        assert "Input/output error" in running.status_reader.last_error
        assert not running.status_reader.disk_short, "it broke, and is not full"
        with pytest.raises(PreconditionError, match="can't be written"):
            await running.operations.start("2", StartOptions())
