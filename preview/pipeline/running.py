"""A pipeline while it runs: what it consists of at the moment, and whether it goes on."""

import asyncio
from dataclasses import dataclass

from preview.pipeline.builder import Parts
from preview.pipeline.plan import Plan


@dataclass
class Running:
    """What those who work on one pipeline share; used on the loop.

    Args:
        plan: in effect.
        parts: of this moment: a camera may take the place of another.
        ended: done when the pipeline has failed or is being stopped; no event is reported from then on.
    """

    plan: Plan
    parts: Parts
    ended: asyncio.Future[None]

    @property
    def has_ended(self) -> bool:
        """Whether it does not go on."""
        return self.ended.done()
