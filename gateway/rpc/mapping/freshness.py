"""The freshness of a measured value, which every message with one carries in the same three fields."""

from typing import Any

from gateway.status.freshness import Freshness


def freshness_fields(freshness: Freshness) -> dict[str, Any]:
    """Returns `available`, `stale` and `age_ms` as keyword arguments of a message."""
    return {"available": freshness.available, "stale": freshness.stale, "age_ms": freshness.age_ms}
