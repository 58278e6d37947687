"""Which faults make an incident: by severity, with a cool-down, merged with one that is being made. Pure."""

from collections.abc import Container, Mapping
from dataclasses import dataclass, field
from typing import Final

SEVERITIES: Final[Mapping[str, int]] = {"info": 1, "warning": 2, "error": 3}
_MAX_FAULTS: Final = 1000


@dataclass(frozen=True, slots=True)
class Rules:
    """When a fault makes an incident.

    Attributes:
        enabled: whether any does.
        min_severity: the lowest that does: 1 info, 2 warning, 3 error.
        cooldown_s: how long a fault makes none after it has made one.
        ignore: IDs of faults that never do.
    """

    enabled: bool = True
    min_severity: int = SEVERITIES["error"]
    cooldown_s: float = 60.0
    ignore: frozenset[str] = frozenset()


@dataclass(slots=True)
class Incidents:
    """Remembers which incident each fault has made."""

    rules: Rules
    _made: dict[str, tuple[float, str]] = field(default_factory=dict)
    """When, in monotonic seconds, and the incident's ID, by fault."""

    def wanted(self, fault_id: str, severity: int) -> bool:
        """Returns whether such a fault makes incidents at all."""
        rules = self.rules
        return rules.enabled and severity >= rules.min_severity and fault_id not in rules.ignore

    def earlier(self, fault_id: str, now_s: float, pending: Container[str]) -> str | None:
        """Returns the incident that a fault has made and that still stands for it; None: a new one is due."""
        made = self._made.get(fault_id)
        if made is None:
            return None
        at_s, incident = made
        return incident if now_s - at_s < self.rules.cooldown_s or incident in pending else None

    def made(self, fault_id: str, incident: str, now_s: float) -> None:
        """Remembers the incident that a fault has made, or was merged with."""
        self._made.pop(fault_id, None)
        while len(self._made) >= _MAX_FAULTS:
            del self._made[next(iter(self._made))]
        self._made[fault_id] = (now_s, incident)
