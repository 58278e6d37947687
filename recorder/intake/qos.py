"""QoS: how to subscribe so that all publishers of a topic are received, and what they offer, for the file."""

from collections.abc import Sequence
from typing import Any, Final

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from recorder.values.offered_qos import OfferedQos, as_yaml

FIRST_DEPTH: Final = 256
"""Before the rate is known: a quarter of a second at 1 kHz."""
_LEAST_DEPTH: Final = 16
_MOST_DEPTH: Final = 20_000
_COVERED_S: Final = 2.0
"""A queue holds what comes in this time, in case the thread gets no CPU for so long."""
MAX_BYTES: Final = 128 * 1024 * 1024
"""Of one topic's queue; two messages fit at any size."""


def profile_of(offers: Sequence[Any], depth: int) -> Any:
    """Returns the profile for a subscription that all of these publishers' endpoints match (DDS 2.2.3).

    Reliable if all are, transient local if all are; best effort and volatile where nothing is known.
    """
    reliable = bool(offers) and all(
        each.qos_profile.reliability == ReliabilityPolicy.RELIABLE for each in offers
    )
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if is_latched(offers) else DurabilityPolicy.VOLATILE,
    )


def is_latched(offers: Sequence[Any]) -> bool:
    """Returns whether all publishers keep messages for late subscribers."""
    return bool(offers) and all(
        each.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for each in offers
    )


def depth_for(rate_hz: float, mean_bytes: float) -> int:
    """Returns the depth for a topic of that rate and message size."""
    wanted = max(_LEAST_DEPTH, round(rate_hz * _COVERED_S))
    return max(2, min(wanted, _MOST_DEPTH, int(MAX_BYTES / max(mean_bytes, 1.0))))


def offered_qos(offers: Sequence[Any]) -> str:
    """Returns the publishers' profiles as rosbag2 writes them into a channel's metadata."""
    return as_yaml([_profile(each.qos_profile) for each in offers])


def _profile(qos: Any) -> OfferedQos:
    return OfferedQos(
        history=_word(qos.history),
        depth=int(qos.depth),
        reliability=_word(qos.reliability),
        durability=_word(qos.durability),
        liveliness=_word(qos.liveliness),
        deadline_ns=int(qos.deadline.nanoseconds),
        lifespan_ns=int(qos.lifespan.nanoseconds),
        liveliness_lease_ns=int(qos.liveliness_lease_duration.nanoseconds),
        avoid_ros_namespace_conventions=bool(qos.avoid_ros_namespace_conventions),
    )


def _word(policy: Any) -> str:
    """Returns rmw's word for a policy: rclpy's names are the same ones."""
    return str(policy.name).lower()
