"""Who makes the pictures: hardware decoders that have proven themselves, else software."""

import threading
from collections.abc import Callable, Mapping
from typing import Final, TypeAlias

from common.errors import UserError
from console.receiver.decoder_probe import HARDWARE, proven_decoder
from console.receiver.errors import StreamError, UndecodableError

_WAIT_S: Final = 3.0
"""How long the first call waits for trials; after that it begins in software."""

Prove: TypeAlias = Callable[[str], str | None]


class Decoders:
    """The choice for one session. Where nothing is installed that could be tried, no process is started.

    Args:
        prove: gives the element for a codec, or None; only tests give another one.
    """

    def __init__(self, prove: Prove = proven_decoder) -> None:
        self._prove = prove
        self._proven: dict[str, str] = {}
        self._distrusted = self._waited = False
        self._trials = threading.Thread(target=self._try_all, name="decoder-trials", daemon=True)

    def start(self) -> None:
        """Begins the trials, beside everything else."""
        self._trials.start()

    def chosen(self) -> Mapping[str, str]:
        """GStreamer's element by codec; a codec that is not named is decoded in software."""
        if self._trials.ident is not None and not self._waited:
            self._trials.join(_WAIT_S)
            self._waited = True
        return {} if self._distrusted else dict(self._proven)

    def after_undecodable(self, trouble: UndecodableError) -> StreamError:
        """What a call ended with that met something undecodable.

        Where hardware was at work this may be its own fault: software is to try, once and for all.
        """
        if self._distrusted or not self._proven:
            return trouble
        self._distrusted = True
        return StreamError(f"hardware decoding failed: {trouble.what}", "Software takes over")

    def after_nothing(self) -> None:
        """A call brought no picture at all. A decoder that hangs looks like that, too."""
        self._distrusted = self._distrusted or bool(self._proven)

    def _try_all(self) -> None:
        for codec in HARDWARE:
            try:
                element = self._prove(codec)
            except UserError:
                # Without GStreamer nothing is decoded, and the first call says so.
                return
            if element:
                self._proven = self._proven | {codec: element}
