"""docs/security.md states the bounds of the audit log as they are."""

from pathlib import Path

import pytest

from gateway.access.repeats import BURST, MAX_CALLERS, MAX_KINDS, MAX_TIMES, WINDOW_S
from gateway.config import AuditSettings
from gateway.status.event_log import CAPACITY, MAX_OLDER_ACTIONS

PAGE = " ".join((Path(__file__).parents[2] / "docs/security.md").read_text(encoding="utf-8").split())
AUDIT = AuditSettings()


@pytest.mark.parametrize(
    "sentence",
    [
        f"It admits {BURST} records, then 1 a minute",
        f"the first of its kind in the last {WINDOW_S:.0f} s",
        f"{MAX_KINDS} kinds per caller are distinguished",
        f"recorded at most {WINDOW_S:.0f} s later",
        f"`times` has the first {MAX_TIMES} and `time` the last",
        f"`motions` has the first {MAX_TIMES} of them and the last one",
        f"more than {MAX_TIMES + 1} calls of each in a minute",
        f"loses the actions of the last {WINDOW_S:.0f} s that were only counted",
        f"{MAX_CALLERS} callers have a bucket each",
        f"{MAX_OLDER_ACTIONS} actions that were not refused stay after they have left the ring of {CAPACITY}",
        f"one bucket of events, which admits {BURST}, then 1 a minute",
        f"{2 * AUDIT.max_kib * AUDIT.generations // 1024} MiB in all by default",
    ],
)
def test_the_page_states_the_bounds(sentence: str) -> None:
    assert sentence in PAGE
