"""Times of motion for the audit log: who drove, how long, how far, and why it ended."""

import time
from collections import deque
from typing import Final, Protocol

from gateway.status.event import ControlAction, ControlResult, Motion
from gateway.status.teleop import DriveEpisode
from gateway.teleop.lease import Driver

_REMEMBERED: Final = 8
"""Drivers, and devices of each: the end of a motion may be reported after its lease and after later holds."""
_NS_PER_S: Final = 1_000_000_000


class EpisodeSink(Protocol):
    """Where times of motion are recorded."""

    def record_action(self, action: ControlAction) -> None:
        """Takes an action of this instant."""


class _Drive:
    """A driver, from their first hold to the next driver's.

    Args:
        driver: who drives.
        began_ns: monotonic.
    """

    def __init__(self, driver: Driver, began_ns: int) -> None:
        self.driver, self.began_ns = driver, began_ns
        self._devices: deque[tuple[int, str]] = deque(maxlen=_REMEMBERED)

    def note(self, device: str, now_ns: int) -> None:
        """Notes what the driver holds with from now on."""
        self._devices.append((now_ns, device))

    def device_at(self, at_ns: int) -> str:
        """Returns what the driver held with at an instant; empty if that is forgotten."""
        return next((device for noted_ns, device in reversed(self._devices) if noted_ns <= at_ns), "")


class Episodes:
    """Records each time of motion that the drive program reports.

    Args:
        sink: where to.
    """

    def __init__(self, sink: EpisodeSink) -> None:
        self._sink = sink
        self._began_ns = time.monotonic_ns()
        self._drives: deque[_Drive] = deque(maxlen=_REMEMBERED)
        self._recorded: tuple[int, int] | None = None

    def note(self, driver: Driver, input_device: str) -> None:
        """Notes who drives from now on, and with what."""
        now_ns = time.monotonic_ns()
        # A driver may change the device with every command, which must displace no other driver.
        if not self._drives or self._drives[-1].driver != driver:
            self._drives.append(_Drive(driver, now_ns))
        self._drives[-1].note(input_device, now_ns)

    def record(self, _instance_id: str, episode: DriveEpisode) -> None:
        """Records a time of motion that has ended, once.

        Also one that an earlier gateway did not live to record, or an earlier drive program to report.
        """
        number = episode.episode_id, episode.started_ns
        if self._recorded == number or self._was_recorded(episode):
            return
        self._recorded = number
        driver, device = self._driver_of(episode)
        duration_s = (episode.ended_ns - episode.started_ns) / _NS_PER_S
        motion = Motion(duration_s, episode.distance_m, episode.turned_rad, device)
        self._sink.record_action(
            ControlAction(
                who=driver.name if driver.role else "",
                address=driver.address or episode.holder,
                method="Drive",
                request=str(motion),
                result=ControlResult.ACCEPTED,
                answer=episode.ended_by,
                role=driver.role,
                credential=driver.credential,
                motion=motion,
            )
        )

    def _driver_of(self, episode: DriveEpisode) -> tuple[Driver, str]:
        """Returns who drove, and with what at last."""
        for drive in reversed(self._drives):
            if drive.driver.name == episode.holder and drive.began_ns <= episode.ended_ns:
                return drive.driver, drive.device_at(episode.ended_ns)
        return Driver("", episode.holder, ""), ""

    def _was_recorded(self, episode: DriveEpisode) -> bool:
        """Whether an earlier gateway has recorded it, as far as an older drive program lets one know."""
        return episode.ended_ns < self._began_ns if episode.recorded is None else episode.recorded
