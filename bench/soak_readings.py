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
            name="soak.rss_growth_mib",
            what=f"resident memory of the preview service, {what}",
            unit="MiB",
            values=[grown_mib],
            bar=5,
            single=True,
        ),
        Row(
            name="soak.fds_growth",
            what=f"its file descriptors, {what}",
            unit="",
            values=[more],
            bar=0,
            single=True,
        ),
    ]
