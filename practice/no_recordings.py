"""What the practice robot answers to calls about recordings: it has no recorder."""

from pathlib import Path
from typing import NoReturn

from console.client import Unsupported
from console.client.exporting import ExportOptions


class NoRecordings:
    """`console.monitor.recordings.RecordingClient` of a robot without a recorder: all raise Unsupported."""

    async def list_recordings(self, page_size: int = 0, page_token: str = "") -> NoReturn:
        """Lists none."""
        del page_size, page_token
        _refuse()

    async def start_recording(self, label: str = "", *, preset: str = "") -> NoReturn:
        """Starts none."""
        del label, preset
        _refuse()

    async def stop_recording(self, recording_id: str = "") -> NoReturn:
        """Stops none."""
        del recording_id
        _refuse()

    async def trigger_snapshot(self, label: str = "", *, pre_s: int | None = None) -> NoReturn:
        """Keeps nothing."""
        del label, pre_s
        _refuse()

    async def recording_thumbnail(self, recording_id: str) -> NoReturn:
        """Returns no picture."""
        del recording_id
        _refuse()

    async def pin_recording(self, recording_id: str, pinned: bool = True) -> NoReturn:
        """Pins none."""
        del recording_id, pinned
        _refuse()

    async def delete_recording(self, recording_id: str, *, expected_sha256: bytes = b"") -> NoReturn:
        """Deletes none."""
        del recording_id, expected_sha256
        _refuse()

    async def export_recording(
        self, recording_id: str, folder: Path, options: ExportOptions | None = None
    ) -> NoReturn:
        """Copies none."""
        del recording_id, folder, options
        _refuse()


def _refuse() -> NoReturn:
    raise Unsupported("the practice robot has no recorder")
