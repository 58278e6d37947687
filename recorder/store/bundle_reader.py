"""Run bundles for callers: what many ask for at once is read once, and no more at a time than permitted."""

import asyncio
import time
from collections.abc import Callable, Sequence
from typing import Final

from common.errors import TooMuchError
from common.open_file import UnreadableError
from common.reader_threads import ReaderThreads
from common.reasons import Reason
from common.tasks import cancel
from recorder.store.run_bundles import Bundle, BundleFile, BundleSummary, RunBundles
from recorder.store.sums import FileState, Sums

LISTED_ANEW_S: Final = 2.0
"""After that the folders are read again for a list."""
OLD_S: Final = 10.0
"""From then on a list is old."""
ANSWER_WITHIN_S: Final = 2.0
"""What has not been read by then is not in the answer."""
ANSWER_INSTEAD_OF_OLD_WITHIN_S: Final = 4.0
"""The same, where the answer would else be an old list, or none. The gateway waits for 5 s."""
MOST_AT_ONCE: Final = 4
"""Bundles whose files are read."""
_RETRY_AFTER_S: Final = 10.0
"""Suggested to a caller for whose bundle there is no place."""


class BundleReader:
    """Reads run bundles; used on one event loop.

    The folders, and the files of a bundle that was asked for, are read to their end, whether or not the
    caller waits: the next one gets the list, or the sums, at once.

    Args:
        bundles: where they are.
        threads: that read folders.
        sums: of files.
        clock: monotonic seconds.
    """

    def __init__(
        self,
        bundles: RunBundles,
        threads: ReaderThreads,
        sums: Sums,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._bundles = bundles
        self._threads = threads
        self._sums = sums
        self._clock = clock
        self._listing: asyncio.Task[None] | None = None
        self._listing_began_s = 0.0
        self._listed: Sequence[BundleSummary] | None = None
        self._listed_s = float("-inf")
        self._reading: dict[str, asyncio.Task[None]] = {}
        """By ID of the bundle."""

    async def all(self) -> Sequence[BundleSummary]:
        """Returns all bundles, without those that can't be read.

        They are as they were at most LISTED_ANEW_S ago; where reading the folders takes longer than
        ANSWER_WITHIN_S, OLD_S ago; and longer than ANSWER_INSTEAD_OF_OLD_WITHIN_S, at the time before.

        Raises:
            TooMuchError: the folders are being read for the first time, or too many callers wait.
        """
        age_s = self._clock() - self._listed_s
        if age_s > LISTED_ANEW_S:
            listing = self._listing
            if listing is None or listing.done():
                listing = self._listing = asyncio.create_task(self._list(), name="list of run bundles")
                self._listing_began_s = self._clock()
            # Of callers who ask for page after page, only the first one waits for a list that takes longer.
            within_s = ANSWER_WITHIN_S if age_s <= OLD_S else ANSWER_INSTEAD_OF_OLD_WITHIN_S
            left_s = self._listing_began_s + within_s - self._clock()
            await asyncio.wait({listing}, timeout=max(0.0, left_s))
            if listing.done():
                listing.result()
        if self._listed is None:
            raise TooMuchError(
                "the robot reads the folders of its experiments for the first time; try again later",
                Reason.TOO_MANY_REQUESTS,
                _RETRY_AFTER_S,
            )
        return self._listed

    async def get(self, bundle_id: str) -> Bundle | None:
        """Returns a bundle; None if there is no such."""
        return await self._threads.run(self._bundles.get, bundle_id)

    async def sums(self, bundle: Bundle, files: Sequence[BundleFile]) -> dict[str, bytes]:
        """Returns sums of files by name, without those that have not been read, or can't be.

        Args:
            bundle: all of whose files are read.
            files: those that the caller asks for.

        Raises:
            TooMuchError: as many bundles as permitted are read.
        """
        states = {file.name: _state_of(bundle, file) for file in files} if bundle.final else {}
        if any(self._sums.known(state) is None for state in states.values()):
            every = [_state_of(bundle, file) for file in bundle.files]
            await asyncio.wait({self._read(bundle.id, every)}, timeout=ANSWER_WITHIN_S)
        known = {name: self._sums.known(state) for name, state in states.items()}
        return {name: sha256 for name, sha256 in known.items() if sha256 is not None}

    async def sha256(self, bundle: Bundle, file: BundleFile) -> bytes | None:
        """Returns the sum of one file; None while it has not been read.

        Raises:
            UnreadableError: the disk can't read it.
            TooMuchError: as many bundles as permitted are read.
        """
        state = _state_of(bundle, file)
        if (known := self._sums.known(state)) is not None:
            return known
        reading = self._read(bundle.id, [state])
        await asyncio.wait({reading}, timeout=ANSWER_WITHIN_S)
        if (known := self._sums.known(state)) is None and reading.done():
            raise UnreadableError("the disk can't read it, or it has changed")
        return known

    async def close(self) -> None:
        """Ends what is being read."""
        self._bundles.stop()
        await cancel([*self._reading.values(), *([self._listing] if self._listing else [])])

    async def _list(self) -> None:
        self._listed = await self._threads.run(self._bundles.all)
        self._listed_s = self._clock()

    def _read(self, bundle_id: str, files: Sequence[FileState]) -> "asyncio.Task[None]":
        """Returns the task that reads these files, unless others of the bundle are being read."""
        if reading := self._reading.get(bundle_id):
            return reading
        if len(self._reading) >= MOST_AT_ONCE:
            raise TooMuchError(
                f"the robot reads the files of {MOST_AT_ONCE} other experiments at present; try again later",
                Reason.TOO_MANY_REQUESTS,
                _RETRY_AFTER_S,
            )
        reading = asyncio.create_task(self._read_all(files), name=f"sums of {bundle_id}")
        self._reading[bundle_id] = reading
        reading.add_done_callback(lambda _: self._reading.pop(bundle_id, None))
        return reading

    async def _read_all(self, files: Sequence[FileState]) -> None:
        for file in files:
            try:
                await self._sums.sha256(file)
            except UnreadableError:
                continue  # It has no sum.
            except TooMuchError:
                return  # Others read too much at present; the next request goes on.


def _state_of(bundle: Bundle, file: BundleFile) -> FileState:
    return FileState(bundle.folder / file.name, file.size, file.changed_ns)
