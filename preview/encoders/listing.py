"""List of all encoders and their trials, for `robot-preview encoders`."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any, Final

from rich.console import Console
from rich.table import Table

from preview.encoders.catalogue import Encoder
from preview.encoders.probe import TrialProber

_WIDTH: Final = 160
_HEADINGS: Final = ("encoder", "family", "element", "codec", "present", "proven", "first byte", "why not")


async def rows(
    prober: TrialProber, encoders: Sequence[Encoder], allowed: Sequence[Encoder]
) -> list[dict[str, Any]]:
    """Tries the encoders in turn and returns one JSON object for each."""
    return [
        {
            "name": encoder.name,
            "family": encoder.family,
            "element": encoder.element,
            "codec": encoder.codec.value,
            "hardware": encoder.hardware,
            "allowed": encoder in allowed,
            **asdict(await prober.verdict(encoder)),
        }
        for encoder in encoders
    ]


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Returns the rows as a table for a terminal."""
    view = Table(*_HEADINGS, box=None)
    for row in rows:
        first_byte_ms = row["first_byte_ms"]
        view.add_row(
            *(row[key] for key in ("name", "family", "element", "codec")),
            *("yes" if row[key] else "no" for key in ("present", "proven")),
            "" if first_byte_ms is None else f"{first_byte_ms:.0f} ms",
            row["reason"],
        )
    console = Console(width=_WIDTH)
    with console.capture() as capture:
        console.print(view)
    return capture.get().rstrip()
