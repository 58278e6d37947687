"""What a look at the graph has found, as values. Pure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class TopicFacts:
    """One topic, without this project's own nodes.

    Attributes:
        publishers, subscribers: their nodes, each once: "controller", or with a namespace "left/controller".
        types: message types that they name.
    """

    name: str
    type: str
    publishers: tuple[str, ...] = ()
    subscribers: tuple[str, ...] = ()
    types: frozenset[str] = frozenset()

    @property
    def wrong_types(self) -> tuple[str, ...]:
        """Types that are not the configured one."""
        return tuple(sorted(self.types - {self.type}))


@dataclass(frozen=True, slots=True)
class Rank:
    """An input or a lock of the multiplexer, as its parameters have it.

    Attributes:
        timeout_s: 0 for none.
    """

    topic: str
    priority: int
    timeout_s: float = 0.0
    lock: bool = False

    def __str__(self) -> str:
        return f"{self.topic} (priority {self.priority})"


@dataclass(frozen=True, slots=True)
class GraphFacts:
    """What the configured topics look like.

    Attributes:
        timeouts: of the base's nodes, in seconds, by "node: parameter"; and as configured.
        foreign_motion: velocities other than zero that reached the base while no driver had the robot.
        ranks: of the multiplexer's inputs and locks, where it says.
    """

    outputs: Sequence[TopicFacts] = ()
    mux_output: TopicFacts | None = None
    lock: TopicFacts | None = None
    stops: Sequence[TopicFacts] = ()
    odometry: TopicFacts | None = None
    timeouts: Mapping[str, float] = field(default_factory=dict)
    foreign_motion: int = 0
    ranks: Sequence[Rank] = ()


@dataclass(frozen=True, slots=True)
class PulseFacts:
    """What a short motion has shown.

    Attributes:
        commanded_mps: of the pulse.
        fastest_mps: by odometry; None without odometry.
        stopped_after_s: from the last velocity on, without a zero; None if it had not stopped in time.
        interrupted: that the pulse was left out or ended early, and why, for people; empty if it was not.
    """

    commanded_mps: float
    fastest_mps: float | None
    stopped_after_s: float | None
    interrupted: str = ""
