"""Which camera is to be live: the wanted one, or what stands in for it. Pure; the supervisor owns it.

The wanted camera and its fallbacks, in turn, are a chain. The first one in it that delivers is to be live.
Each camera that failed waits for a retry of its own, with growing pauses, beside whatever is live:

| live | the wanted camera | its fallback | next attempt |
|---|---|---|---|
| the wanted one | - | - | none |
| none | may be tried | any | the wanted one |
| none | waits for its retry | may be tried | the fallback |
| the fallback | waits for its retry | - | none, then the wanted one |
| one outside the chain | waits for its retry | may be tried | the fallback |
| one outside the chain | waits for its retry | there is none | none: the live one stays |
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Final

from common.backoff import Backoff

FIRST_RETRY_S: Final = 1.0
LONGEST_RETRY_S: Final = 30.0
STEADY_AFTER_S: Final = 15.0
"""A camera that was live this long has recovered: its pauses start again."""


class CameraState(Enum):
    """What is known of a camera."""

    READY = "ready"
    """It is there, and delivered when it was last used, or has not been used yet."""
    STARTING = "starting"
    """It is being started, to become the live one."""
    LIVE = "live"
    """Its frames are the stream's."""
    FAILED = "failed"
    """It is missing, its topic is not published, or it failed when it was last used."""


@dataclass(frozen=True, slots=True)
class Camera:
    """One camera.

    Args:
        name: in the configuration.
        state: at this moment.
        error: why it has failed, and what to do, for people; empty unless it has.
        fallback: camera that takes its place while it fails; empty for none.
    """

    name: str
    state: CameraState
    error: str = ""
    fallback: str = ""


@dataclass(slots=True)
class _Record:
    """What is remembered of a camera."""

    backoff: Backoff
    failure: str = ""
    """Of its newest use; empty if that went well."""
    retry_at: float = 0.0
    missing: str = ""
    """Why it can't be used before it is even started; empty if it could."""
    live_since: float | None = None


class Cameras:
    """All cameras of a configuration.

    Args:
        fallbacks: by name, in the order of the configuration; None for none.

    Attributes:
        wanted: the camera that is to be live.
    """

    def __init__(self, fallbacks: Mapping[str, str | None]) -> None:
        self._fallbacks = dict(fallbacks)
        self._records = {name: _Record(Backoff(FIRST_RETRY_S, LONGEST_RETRY_S)) for name in fallbacks}
        self.wanted = next(iter(fallbacks))

    @property
    def names(self) -> tuple[str, ...]:
        """All names, in the order of the configuration."""
        return tuple(self._fallbacks)

    @property
    def chain(self) -> tuple[str, ...]:
        """The wanted camera, its fallback, the fallback's fallback, each once."""
        chain: list[str] = []
        name: str | None = self.wanted
        while name is not None and name not in chain:
            chain.append(name)
            name = self._fallbacks[name]
        return tuple(chain)

    def want(self, name: str) -> None:
        """Takes a request of an operator: another camera is wanted, or the same one at once.

        Args:
            name: of a known camera; empty: the wanted one stays.
        """
        self.wanted = name or self.wanted
        for each in self.chain:
            self._records[each].retry_at = 0.0

    def next_attempt(self, live: str | None, now: float) -> str | None:
        """Returns the camera to start now; None if there is none better than the live one.

        Args:
            live: camera whose frames flow; None if none do.
            now: monotonic seconds.
        """
        for name in self._before(live):
            record = self._records[name]
            if not record.failure or now >= record.retry_at:
                return name
        return None

    def wait_s(self, live: str, now: float) -> float | None:
        """Returns the seconds until a better camera than the live one may be tried; None if there is none."""
        waits = [self._records[name].retry_at - now for name in self._before(live)]
        return max(0.0, min(waits)) if waits else None

    def delivers(self, name: str, now: float) -> None:
        """Records the first frame of a camera."""
        record = self._records[name]
        record.failure, record.missing, record.live_since = "", "", now

    def failed(self, name: str, failure: str, now: float) -> None:
        """Records that a camera failed, while it was live or started."""
        record = self._records[name]
        if record.live_since is not None and now - record.live_since >= STEADY_AFTER_S:
            record.backoff.reset()
        record.failure, record.live_since = failure, None
        record.retry_at = now + record.backoff.next_s()

    def found(self, problems: Mapping[str, str]) -> None:
        """Takes which cameras could be started at all: a camera that is there again may be tried at once.

        Args:
            problems: by name; empty for a camera that could be. Others stay as they are.
        """
        for name, missing in problems.items():
            record = self._records[name]
            if record.missing and not missing:
                record.failure, record.retry_at = "", 0.0
                record.backoff.reset()
            record.missing = missing

    def listed(self, live: str | None, starting: str | None) -> tuple[Camera, ...]:
        """Returns all cameras, in the order of the configuration.

        Args:
            live: camera whose frames flow; None if none do.
            starting: camera that is being started; None if none is.
        """
        return tuple(self._camera(name, live, starting) for name in self._fallbacks)

    def _before(self, live: str | None) -> Iterable[str]:
        """Returns the cameras that are better than the live one."""
        chain = self.chain
        return chain[: chain.index(live)] if live in chain else chain

    def _camera(self, name: str, live: str | None, starting: str | None) -> Camera:
        record, fallback = self._records[name], self._fallbacks[name] or ""
        if name == live:
            return Camera(name, CameraState.LIVE, fallback=fallback)
        if name == starting:
            return Camera(name, CameraState.STARTING, fallback=fallback)
        error = record.missing or record.failure
        return Camera(name, CameraState.FAILED if error else CameraState.READY, error, fallback)
