"""Chooses the decoders: hardware that has passed its trial, else software."""

import threading
from collections.abc import Callable, Mapping
from typing import Final

from common.errors import UserError
from console.receiver.decoder_probe import HARDWARE, proven_decoder
from console.receiver.errors import StreamError, UndecodableError, hung
from console.receiver.options import CLOSES_WITHIN_S

_TRIALS_TIMEOUT_S: Final = 3.0
"""How long the first connection waits for trials; after that it begins in software."""


class Decoders:
    """The choice for one session. Where no candidate is installed, no process is started.

    Args:
        prove: returns the hardware decoder for a codec, or None; tests pass a double.
    """

    def __init__(self, prove: Callable[[str], str | None] = proven_decoder) -> None:
        self._prove = prove
        self._proven: dict[str, str] = {}
        self._software_only = self._waited = False
        self._trials = threading.Thread(target=self._try_all, name="decoder-trials", daemon=True)

    def start(self) -> None:
        """Starts the trials, in the background."""
        self._trials.start()

    def chosen(self) -> Mapping[str, str]:
        """Returns GStreamer's element by codec; a codec without one is decoded in software."""
        if self._trials.ident is not None and not self._waited:
            self._trials.join(_TRIALS_TIMEOUT_S)
            self._waited = True
        return {} if self._software_only else dict(self._proven)

    def after_undecodable(self, error: UndecodableError) -> StreamError:
        """Returns the error of a connection that ended with a decoding error.

        A hardware decoder may have caused it: the session falls back to software, once and for all.
        """
        if self._software_only or not self._proven:
            return error
        self._software_only = True
        return StreamError(f"hardware decoding failed: {error.what}", "Software takes over")

    def after_hang(self) -> StreamError:
        """Returns the error of a connection that could not be closed.

        The driver of a hardware decoder may hang: the session falls back to software, once and for all.
        """
        self.after_no_frame()
        return hung(CLOSES_WITHIN_S)

    def after_no_frame(self) -> None:
        """Falls back to software after a connection without any frame: a hung decoder looks like that."""
        self._software_only = self._software_only or bool(self._proven)

    def _try_all(self) -> None:
        for codec in HARDWARE:
            try:
                element = self._prove(codec)
            except (UserError, ImportError):
                # GStreamer is missing; the first connection reports it. An ImportError is what Python makes
                # of that where another thread imports it at the same time.
                return
            if element:
                self._proven = self._proven | {codec: element}
