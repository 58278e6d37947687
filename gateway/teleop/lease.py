"""The lease: which session may drive. Pure; instants are monotonic seconds given by the caller.

One table decides who gets it. The drive program has the lease that is granted here, and decides whether the
robot moves.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Final

from gateway.status.teleop import LeaseEnd

SILENCE_S: Final = 2.0
"""A session ends after this long without a command."""
RELEASED_S: Final = 2.0
"""An operator may take the lease from a driver who has not held for this long."""
MAX_LANES: Final = 3
"""Of a session. A packet that is lost with its repetition holds a lane up for longer than a command is valid:
in an hour of virtual time on a link that loses 10 %, two lanes at once stopped a driver 13 times, three not
once (the model of tests/unit/console/client/test_lossy_lanes.py, seeds 1 to 6); on real connections, two did
so eight times in ten minutes, three not once (`drive.false_stops_very_lossy`)."""
LANE_SILENT_S: Final = 1.0
"""A lane that has brought nothing for so long makes room for another one of its session: fifty commands were
due on it. A driver gives up a connection that has vanished, and opens the next, before the gateway does."""


class Demand(Enum):
    """What a caller demands."""

    OPEN = "open"
    TAKE_OVER = "take over"
    TAKE_OVER_AS_ADMIN = "take over as an administrator"
    UNARY = "drive by single commands"


class Occupancy(Enum):
    """Who has the lease, as seen by the caller."""

    FREE = "no one"
    OWN_UNARY = "the same caller, by single commands"
    RESTING = "another driver, who has not held for RELEASED_S"
    HOLDING = "another driver, who has held within RELEASED_S"


class Answer(Enum):
    """What follows."""

    GRANT = "grant"
    """A new session gets the lease; that of another ends."""
    CONTINUE = "continue"
    """The caller's session goes on."""
    REFUSE = "refuse"
    REFUSE_TOO_EARLY = "refuse, too early to take over"


ANSWERS: Final[Mapping[Demand, Mapping[Occupancy, Answer]]] = {
    Demand.OPEN: {
        Occupancy.FREE: Answer.GRANT,
        Occupancy.OWN_UNARY: Answer.GRANT,
        Occupancy.RESTING: Answer.REFUSE,
        Occupancy.HOLDING: Answer.REFUSE,
    },
    Demand.TAKE_OVER: {
        Occupancy.FREE: Answer.GRANT,
        Occupancy.OWN_UNARY: Answer.GRANT,
        Occupancy.RESTING: Answer.GRANT,
        Occupancy.HOLDING: Answer.REFUSE_TOO_EARLY,
    },
    Demand.TAKE_OVER_AS_ADMIN: dict.fromkeys(Occupancy, Answer.GRANT),
    Demand.UNARY: {
        Occupancy.FREE: Answer.GRANT,
        Occupancy.OWN_UNARY: Answer.CONTINUE,
        Occupancy.RESTING: Answer.REFUSE,
        Occupancy.HOLDING: Answer.REFUSE,
    },
}
"""Total: a test checks each pair."""


class LeaseRefusedError(Exception):
    """Another driver has the lease.

    Args:
        holder: who, for people.
        answer: one of the refusals.
    """

    def __init__(self, holder: str, answer: Answer) -> None:
        super().__init__(answer.value)
        self.holder = holder
        self.answer = answer


class NotInSessionError(Exception):
    """The session has ended, never was, or belongs to another driver."""


class TooManyLanesError(Exception):
    """The session has all lanes that it may have."""


@dataclass(frozen=True, slots=True)
class Driver:
    """A caller that drives.

    Attributes:
        key: the same for all calls of one caller: the name on the credential, or the address.
        name: for people.
        address: of the connection, for the audit log.
        role: for the audit log; empty where callers are not authenticated.
        admin: may take over at any time.
    """

    key: str
    name: str
    address: str
    role: str = ""
    credential: str = ""
    admin: bool = False


@dataclass(eq=False, slots=True)
class Session:
    """One driver's use of the lease.

    Attributes:
        streaming: commands come all the time; otherwise one by one, as older tools send them.
        heard_s: when the newest command arrived, or the session began.
        held_s: when the driver last held.
        sequence: of the newest command.
        lanes: open ones by number, with when the newest command came on each; none of a session that does not
            stream.
        ended: why; None while it has the lease.
    """

    session_id: str
    driver: Driver
    streaming: bool
    line_of_sight: bool
    heard_s: float
    held_s: float = -math.inf
    sequence: int = 0
    lanes: dict[int, float] = field(default_factory=dict)
    ended: LeaseEnd | None = None


class Lease:
    """The one lease of a robot."""

    def __init__(self) -> None:
        self.holder: Session | None = None
        self._lanes = 0

    def acquire(
        self, session_id: str, driver: Driver, demand: Demand, now_s: float, *, line_of_sight: bool
    ) -> tuple[Session, Session | None]:
        """Returns the session that has the lease now, and the one that lost it to this call.

        Args:
            session_id: of a new session; never used before.
            driver: the caller.
            demand: what the caller demands.
            now_s: the present instant.
            line_of_sight: whether a new session is not supervised by a picture.

        Raises:
            LeaseRefusedError: another driver has the lease.
        """
        last = self.holder
        answer = ANSWERS[demand][self.occupancy(driver, now_s)]
        if last and answer is Answer.CONTINUE:
            return last, None
        if last and answer is not Answer.GRANT:
            raise LeaseRefusedError(last.driver.name, answer)
        if last:
            self.end(last, LeaseEnd.TAKEN_OVER)
        streaming = demand is not Demand.UNARY
        self.holder = Session(session_id, driver, streaming, line_of_sight or not streaming, now_s)
        return self.holder, last

    def occupancy(self, driver: Driver, now_s: float) -> Occupancy:
        """Returns who has the lease, as seen by a driver."""
        holder = self.holder
        if holder is None:
            return Occupancy.FREE
        if not holder.streaming and holder.driver.key == driver.key:
            return Occupancy.OWN_UNARY
        return Occupancy.RESTING if now_s - holder.held_s >= RELEASED_S else Occupancy.HOLDING

    def find(self, session_id: str, driver: Driver) -> Session:
        """Returns the session that a driver has, for another lane of it.

        Raises:
            NotInSessionError: it is not the present one, or another driver's.
        """
        holder = self.holder
        if holder is None or holder.session_id != session_id or holder.driver.key != driver.key:
            raise NotInSessionError
        return holder

    def add_lane(self, session: Session, now_s: float) -> int:
        """Returns the number of a new lane; one that is silent makes room for it.

        Raises:
            TooManyLanesError: the session has MAX_LANES that are not.
        """
        if len(session.lanes) >= MAX_LANES:
            silent = min(session.lanes, key=session.lanes.__getitem__)
            if now_s - session.lanes[silent] < LANE_SILENT_S:
                raise TooManyLanesError
            del session.lanes[silent]
        self._lanes += 1
        session.lanes[self._lanes] = now_s
        return self._lanes

    def lane_heard(self, session: Session, lane: int, now_s: float) -> None:
        """Notes that a command has come on a lane."""
        if lane in session.lanes:
            session.lanes[lane] = now_s

    def take(self, session: Session, sequence: int, now_s: float, *, held: bool) -> bool:
        """Takes a command; returns whether it counts: the session has the lease, and the command is newer.

        Of a command that arrives on several lanes the first copy counts.
        """
        if session.ended or sequence <= session.sequence:
            return False
        session.sequence, session.heard_s = sequence, now_s
        if held:
            session.held_s = now_s
        return True

    def lane_gone(self, session: Session, lane: int, why: LeaseEnd) -> bool:
        """Removes a lane; the last one ends the session, and then this returns True."""
        session.lanes.pop(lane, None)
        if session.ended or session.lanes:
            return False
        self.end(session, why)
        return True

    def silent(self, now_s: float) -> Session | None:
        """Ends the session after SILENCE_S without a command, and returns it; None if it goes on."""
        holder = self.holder
        if holder is None or now_s - holder.heard_s < SILENCE_S:
            return None
        # Silence is all that single commands have for an end.
        self.end(holder, LeaseEnd.LOST if holder.streaming else LeaseEnd.CLOSED)
        return holder

    def end(self, session: Session, why: LeaseEnd) -> None:
        """Ends a session."""
        if session.ended is None:
            session.ended = why
        if self.holder is session:
            self.holder = None
