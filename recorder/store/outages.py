"""When the ring was not written: what snapshots lack. Pure; instants are calendar ns."""

from collections import deque
from collections.abc import Iterable
from dataclasses import replace
from typing import Final

from recorder.values import Gap, GapCause

_MAX_OUTAGES: Final = 100


class Outages:
    """The newest 100 outages."""

    def __init__(self) -> None:
        self._past: deque[Gap] = deque(maxlen=_MAX_OUTAGES)
        self._present: Gap | None = None

    @property
    def known(self) -> bool:
        """Whether there is, or was, any."""
        return bool(self._present or self._past)

    @property
    def present(self) -> Gap | None:
        """The one that lasts, from when on; None if there is none."""
        return self._present

    def begin(self, cause: GapCause, at_ns: int) -> None:
        """Takes note that nothing is written from an instant on; one that lasts already goes on."""
        if self._present is None:
            self._present = Gap("", cause, at_ns, at_ns, None)

    def add(self, outages: Iterable[Gap]) -> None:
        """Takes note of some that have ended."""
        self._past.extend(outages)

    def end(self, now_ns: int) -> None:
        """Takes note that it is written again, if it was not."""
        if self._present:
            self._past.append(_until(self._present, now_ns))
            self._present = None

    def within(self, from_ns: int, until_ns: int, now_ns: int) -> tuple[Gap, ...]:
        """Returns the parts of outages that lie between two instants; one that lasts is taken as of now."""
        present = (_until(self._present, now_ns),) if self._present else ()
        return parts_within((*self._past, *present), from_ns, until_ns)


def parts_within(gaps: Iterable[Gap], from_ns: int, until_ns: int) -> tuple[Gap, ...]:
    """Returns the parts of gaps that lie between two instants."""
    return tuple(
        replace(each, began_ns=max(each.began_ns, from_ns), ended_ns=min(each.ended_ns, until_ns))
        for each in gaps
        if each.began_ns < until_ns and each.ended_ns > from_ns
    )


def _until(outage: Gap, now_ns: int) -> Gap:
    # The calendar clock may have been set back.
    return replace(outage, ended_ns=max(outage.began_ns, now_ns))
