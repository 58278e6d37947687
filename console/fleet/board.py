"""The fleet while it is watched: takes what the hub's buckets hold, and returns rows. No input or output."""

from typing import Final

from console.fleet.model import ReportedState, fleet_rows
from console.fleet.values import Enrolment, FleetRow
from console.fleet.wire import enrolment_of, state_of
from fleet.connection import Entry

MOST_ROBOTS: Final = 10_000
"""Further ones are not shown: what a hub makes this computer keep is bounded."""
_MS_PER_S: Final = 1000


class FleetBoard:
    """The hub's list of robots and their newest states."""

    def __init__(self) -> None:
        self._enrolled: dict[str, Enrolment] = {}
        self._states: dict[str, ReportedState] = {}

    def take_robot(self, entry: Entry) -> None:
        """Takes an entry of the bucket of enrolled robots."""
        if entry.deleted:
            self._enrolled.pop(entry.key, None)
        elif entry.key in self._enrolled or len(self._enrolled) < MOST_ROBOTS:
            found = enrolment_of(entry.key, entry.value, _unix_ms(entry))
            self._enrolled[found.robot] = found

    def take_state(self, entry: Entry) -> None:
        """Takes an entry of the bucket of states."""
        if entry.deleted:
            self._states.pop(entry.key, None)
        elif entry.key in self._states or len(self._states) < MOST_ROBOTS:
            content = state_of(entry.key, entry.value)
            self._states[entry.key] = ReportedState(content, _unix_ms(entry))

    def robot(self, name: str) -> Enrolment | None:
        """Returns the entry of a robot in the hub's list; None without one."""
        return self._enrolled.get(name)

    def rows(self, now_unix_ms: int) -> tuple[FleetRow, ...]:
        """Returns a row for each robot, by name.

        Args:
            now_unix_ms: Now, by the hub's clock.
        """
        return fleet_rows(self._enrolled, self._states, now_unix_ms)


def _unix_ms(entry: Entry) -> int:
    return round(entry.unix_s * _MS_PER_S)
