"""QoS profiles as a channel's metadata has them ("offered_qos_profiles"). Pure, but for the YAML it writes.

With rmw's words (qos_string_conversions.c), as rosbag2 writes them from version 9 of its metadata on. Before
that it wrote numbers, and it still takes a profile whose history is a number for one of those.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import yaml

INFINITE_NS: Final = (1 << 63) - 1
"""rmw's RMW_DURATION_INFINITE."""
_NS_PER_S: Final = 1_000_000_000


@dataclass(frozen=True, slots=True)
class OfferedQos:
    """What one publisher offers.

    Attributes:
        history: "keep_last", "keep_all", "system_default", or "unknown", which DDS endpoints do not announce.
        depth: 0 if unknown.
        reliability: "reliable", "best_effort" and so on.
        durability: "volatile", "transient_local" and so on.
        liveliness: "automatic", "manual_by_topic" and so on.
        deadline_ns, lifespan_ns, liveliness_lease_ns: INFINITE_NS where there is no limit.
    """

    history: str = "unknown"
    depth: int = 0
    reliability: str = "reliable"
    durability: str = "volatile"
    liveliness: str = "automatic"
    deadline_ns: int = INFINITE_NS
    lifespan_ns: int = INFINITE_NS
    liveliness_lease_ns: int = INFINITE_NS
    avoid_ros_namespace_conventions: bool = False


def as_yaml(profiles: Sequence[OfferedQos]) -> str:
    """Returns the profiles as rosbag2 writes them; empty where there are none."""
    return str(yaml.safe_dump([_fields(each) for each in profiles], sort_keys=False)) if profiles else ""


def _fields(qos: OfferedQos) -> dict[str, Any]:
    return {
        "history": qos.history,
        "depth": qos.depth,
        "reliability": qos.reliability,
        "durability": qos.durability,
        "deadline": _duration(qos.deadline_ns),
        "lifespan": _duration(qos.lifespan_ns),
        "liveliness": qos.liveliness,
        "liveliness_lease_duration": _duration(qos.liveliness_lease_ns),
        "avoid_ros_namespace_conventions": qos.avoid_ros_namespace_conventions,
    }


def _duration(duration_ns: int) -> dict[str, int]:
    seconds, nanoseconds = divmod(duration_ns, _NS_PER_S)
    return {"sec": seconds, "nsec": nanoseconds}
