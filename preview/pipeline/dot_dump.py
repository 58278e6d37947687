"""A pipeline that failed is kept as a drawing, for whoever looks for the reason."""

import logging
from pathlib import Path
from typing import Final

from preview.pipeline.runner import Runner
from preview.pipeline.threads import in_thread

_log = logging.getLogger(__name__)

DRAWING: Final = "last-fault.dot"
_DEADLINE_S: Final = 0.3


async def keep_drawing(runner: Runner, directory: Path) -> None:
    """Writes the pipeline as a DOT graph; where that is impossible, or takes long, the log says so."""
    path = directory / DRAWING

    def draw() -> None:
        directory.mkdir(parents=True, exist_ok=True)
        path.write_text(runner.draw(), encoding="utf-8")

    try:
        await in_thread(draw, _DEADLINE_S)
    except (TimeoutError, OSError) as error:
        _log.warning("no drawing of the failed pipeline in %s: %s", path, error)
