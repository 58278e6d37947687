"""Folds repeated control actions, so that no caller can fill the audit log or the event log. Pure.

Each caller has a token bucket. An action is recorded at once if there is a token, or if it is the first of
its kind in a while: repeats of one thing do not hold back another. Others are counted, and recorded as one
fold at the end of a window, whether or not the caller continues.
"""

import time
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field, replace
from typing import Any, Final

from common.token_bucket import TokenBucket
from gateway.status.event import ControlAction

BURST: Final = 10
"""Capacity of a bucket, in tokens; each record takes one."""
WINDOW_S: Final = 60.0
"""Longest delay of a fold, in seconds; also the time in which a bucket gains one token."""
MAX_KINDS: Final = 8
"""Different actions of one caller with a fold each; further ones share one per result."""
MAX_CALLERS: Final = 64
"""Callers, beyond which new addresses share the bucket and folds of one. None is dropped to make room: that
would refill its bucket. Names always have their own: there are as many as the robot has credentials."""
MAX_TIMES: Final = 16
"""Actions of a fold whose times are kept, and what each has moved, besides the newest: from them follows the
order in which a caller alternated between several, unless it did so more often than a person would."""
_OVERFLOW: Final = ""
"""The caller that stands for all addresses beyond MAX_CALLERS."""
_TEXTS: Final = ("who", "address", "method", "request", "answer", "role", "credential")
_AND_OTHERS: Final = " and others"


@dataclass(slots=True)
class _Fold:
    """The actions of one kind since the last record of one; None if there are none."""

    action: ControlAction | None = None
    recorded_s: float = 0.0


@dataclass(slots=True)
class _Caller:
    bucket: TokenBucket
    folds: dict[Hashable, _Fold] = field(default_factory=dict)
    """By kind of action; open until a window has passed without one."""

    def take_token(self, now_s: float) -> bool:
        return self.bucket.take(now_s, capacity=BURST, refill_per_s=1 / WINDOW_S)


class Repeats:
    """Records control actions, repeated ones folded. Used on one event loop alone.

    Args:
        write: records an action, which may stand for several.
        clock: monotonic seconds.
        max_kinds: different actions of one caller with a fold each; further ones share one per result.
    """

    def __init__(
        self,
        write: Callable[[ControlAction], None],
        clock: Callable[[], float] = time.monotonic,
        *,
        max_kinds: int = MAX_KINDS,
    ) -> None:
        self._write = write
        self._clock = clock
        self._max_kinds = max_kinds
        self._callers: dict[str, _Caller] = {}

    def take(self, action: ControlAction, address_prefix: str, *, authenticated: bool = True) -> None:
        """Records an action of this instant, or counts it.

        Args:
            action: not yet folded.
            address_prefix: where it came from, without what the sender can choose.
            authenticated: whether its `who` is; one that the sender can choose is no caller of its own.
        """
        now_s = self._clock()
        caller = self._caller(action.who if authenticated else "", address_prefix, now_s)
        what = action.motion.device if action.motion else action.request
        kind: Hashable = replace(action, address=address_prefix, request=what, request_id="")
        if kind not in caller.folds and len(caller.folds) >= self._max_kinds:
            kind = action.result
        new = kind not in caller.folds
        fold = caller.folds.setdefault(kind, _Fold())
        fold.action = _combined(fold.action, action) if fold.action else action
        if caller.take_token(now_s) or new:
            self._record(fold, now_s)

    def record_due(self) -> None:
        """Records the folds whose window has ended; to be called a few times a second."""
        now_s = self._clock()
        for name, caller in list(self._callers.items()):
            for kind, fold in list(caller.folds.items()):
                if now_s - fold.recorded_s < WINDOW_S:
                    continue
                if fold.action is None:
                    del caller.folds[kind]
                    continue
                caller.take_token(now_s)
                self._record(fold, now_s)
            # A bucket that is full may be forgotten: a new one holds no more.
            if not caller.folds and now_s - caller.bucket.updated_s >= BURST * WINDOW_S:
                del self._callers[name]

    def record_all(self) -> None:
        """Records all folds as they stand, for the end of the program."""
        now_s = self._clock()
        for caller in self._callers.values():
            for fold in caller.folds.values():
                self._record(fold, now_s)

    def _caller(self, who: str, address_prefix: str, now_s: float) -> _Caller:
        key = who or address_prefix
        if not who and key not in self._callers and len(self._callers) >= MAX_CALLERS:
            key = _OVERFLOW
        return self._callers.setdefault(key, _Caller(TokenBucket(BURST, now_s)))

    def _record(self, fold: _Fold, now_s: float) -> None:
        if fold.action is None:
            return
        self._write(fold.action)
        fold.action, fold.recorded_s = None, now_s


def _combined(older: ControlAction, newer: ControlAction) -> ControlAction:
    """Returns the newer action with the count of both; where their texts differ, it says so.

    Args:
        older: one action, or those that were combined so far.
        newer: one action.
    """
    differing: dict[str, Any] = {
        name: f"{getattr(newer, name)}{_AND_OTHERS}"
        for name in _TEXTS
        if getattr(older, name) != getattr(newer, name)
    }
    if older.motion and newer.motion:
        motion = older.motion.and_then(newer.motion)
        earlier = (older.motions or (older.motion,))[:MAX_TIMES]
        differing |= {"request": str(motion), "motion": motion, "motions": (*earlier, newer.motion)}
    earlier_unix_s = (*older.earlier_unix_s, older.unix_s)[:MAX_TIMES]
    return replace(newer, count=older.count + 1, earlier_unix_s=earlier_unix_s, **differing)
