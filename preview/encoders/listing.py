"""The list of encoders for a person or a program."""

from typing import Any, Final

from rich.console import Console
from rich.table import Table

from preview.app import new_prober, preference
from preview.config import PreviewSettings
from preview.encoders.catalogue import Encoder
from preview.encoders.selection import Verdict

_WIDTH: Final = 160


async def try_all(settings: PreviewSettings) -> list[dict[str, Any]]:
    """Tries every encoder, those that the configuration allows first."""
    prober = new_prober(settings)
    allowed = settings.encoders.allowed
    return [
        _row(encoder, await prober.verdict(encoder), allowed=encoder.name in allowed)
        for encoder in preference(settings)
    ]


def table(rows: list[dict[str, Any]]) -> str:
    """The rows for a person."""
    view = Table(
        "encoder", "family", "element", "codec", "present", "proven", "first byte", "why not", box=None
    )
    for row in rows:
        first_byte_ms = row["first_byte_ms"]
        view.add_row(
            row["name"],
            row["family"],
            row["element"],
            row["codec"],
            "yes" if row["present"] else "no",
            "yes" if row["proven"] else "no",
            "" if first_byte_ms is None else f"{first_byte_ms:.0f} ms",
            row["reason"],
        )
    console = Console(width=_WIDTH)
    with console.capture() as capture:
        console.print(view)
    return capture.get().rstrip()


def _row(encoder: Encoder, verdict: Verdict, *, allowed: bool) -> dict[str, Any]:
    return {
        "name": encoder.name,
        "family": encoder.family,
        "element": encoder.element,
        "codec": encoder.codec.value,
        "hardware": encoder.hardware,
        "allowed": allowed,
        "present": verdict.present,
        "proven": verdict.proven,
        "reason": verdict.reason,
        "first_byte_ms": verdict.first_byte_ms,
    }
