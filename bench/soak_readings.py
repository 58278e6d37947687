"""What a soak reads of a program, and what the readings say about growth."""

from dataclasses import dataclass

from bench.rows import Row


@dataclass(frozen=True, slots=True)
class Reading:
    """Of the service while the preview is off."""

    resident_mib: float
    descriptors: int


def judge(readings: list[Reading], minutes: float) -> list[Row]:
    """What the readings say, in the order they were taken."""
    tenth = len(readings) // 10
    early, late = readings[tenth : 2 * tenth], readings[-tenth:]
    what = f"over {len(readings)} rounds in {minutes:g} min of enable, join, switch, leave, disable"
    grown_mib = min(r.resident_mib for r in late) - min(r.resident_mib for r in early)
    more = min(r.descriptors for r in late) - min(r.descriptors for r in early)
    return [
        Row(
            "soak.rss_growth_mib",
            f"resident memory of the preview service, {what}",
            "MiB",
            grown_mib,
            None,
            5,
        ),
        Row("soak.fds_growth", f"its file descriptors, {what}", "", more, None, 0),
    ]
