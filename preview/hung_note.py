"""A note to the next process: which encoder hung. Without it, that one would prove itself and hang again."""

import json
import logging
import time
from pathlib import Path
from typing import Final

from preview.selection import Selection

_log = logging.getLogger(__name__)

_NAME: Final = "hung-encoder.json"


class HungNote:
    """One small file in the runtime directory, read once."""

    def __init__(self, runtime_dir: Path) -> None:
        self._path = runtime_dir / _NAME

    def leave(self, encoder: str, why: str) -> None:
        """Writes the note; without a writable directory the next process must find out by itself."""
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._path.write_text(json.dumps({"encoder": encoder, "why": why}), encoding="utf-8")
        except OSError as error:
            _log.warning("no note about %s in %s: %s", encoder, self._path, error)

    def tell(self, selection: Selection) -> None:
        """Reads the note, has the encoder passed over, and removes the note."""
        try:
            note = json.loads(self._path.read_text(encoding="utf-8"))
            self._path.unlink()
            name, why = str(note["encoder"]), str(note["why"])
        except FileNotFoundError:
            return
        except (OSError, ValueError, KeyError, TypeError) as error:
            _log.warning("the note %s can't be used: %s", self._path, error)
            return
        selection.pass_over(name, f"encoder {name} ended the last process: {why}", time.monotonic())
