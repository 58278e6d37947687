"""A note to the next process about the encoder in use.

A driver can take this process with it: by a crash, or by a hang that only the end of the process resolves.
The next process would find that the encoder proves itself in its trial, use it, and die again; the note makes
it pass that encoder over for a while. A process that was killed from outside says nothing about its encoder.

One small file in the runtime directory (a tmpfs, so a reboot forgets it), written when an encoder begins and
removed when it has stopped well.
"""

import json
import logging
import time
from pathlib import Path
from typing import Final

from preview.encoders.selection import Selection

_log = logging.getLogger(__name__)

_NAME: Final = "encoder-in-use.json"
_IN_USE: Final = ""
"""No verdict yet: only a crash makes one of it."""


class EncoderNote:
    """The file.

    Args:
        runtime_dir: where it is; made when it doesn't exist.
    """

    def __init__(self, runtime_dir: Path) -> None:
        self._path = runtime_dir / _NAME

    def begin(self, encoder: str) -> None:
        """An encoder is about to be used."""
        self.leave(encoder, _IN_USE)

    def leave(self, encoder: str, why: str) -> None:
        """Writes the note; without a writable directory the next process must find out by itself."""
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._path.write_text(json.dumps({"encoder": encoder, "why": why}), encoding="utf-8")
        except OSError as error:
            _log.warning("no note about encoder %s in %s: %s", encoder, self._path, error)

    def end(self) -> None:
        """The encoder has stopped well."""
        try:
            self._path.unlink(missing_ok=True)
        except OSError as error:
            _log.warning("the note %s can't be removed: %s", self._path, error)

    def tell(self, selection: Selection, crash: str) -> None:
        """Has the encoder that the last process left a note about passed over, if that one was to blame.

        Args:
            selection: what passes it over.
            crash: what the last process died of; empty when it did not crash.
        """
        try:
            note = json.loads(self._path.read_text(encoding="utf-8"))
            name, why = str(note["encoder"]), str(note["why"])
        except FileNotFoundError:
            return
        except (OSError, ValueError, KeyError, TypeError) as error:
            _log.warning("the note %s can't be used: %s", self._path, error)
            return
        self.end()
        if why == _IN_USE and not crash:
            _log.info("the last process was ended from outside while encoder %s was in use", name)
            return
        why = why or f"the process crashed while it was in use ({crash})"
        sentence = f"encoder {name} is passed over: {why}"
        _log.warning("%s", sentence)
        selection.pass_over(name, sentence, time.monotonic())
