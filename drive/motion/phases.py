"""Phases of driving: one table of transitions.

Pure. `drive.motion.machine` finds out what has happened and looks up the next phase here; a trigger that the
table does not list for a phase changes nothing.
"""

from collections.abc import Mapping
from enum import Enum
from types import MappingProxyType
from typing import Final


class Phase(Enum):
    """Phase of driving. What is published in each stands in docs/driving.md."""

    DISABLED = "disabled"
    """Driving is impossible; nothing is published."""
    AVAILABLE = "available"
    """There is no driver; nothing is published, so that other sources of commands have the robot."""
    ARMED = "armed"
    """A driver has the lease and does not hold: zeros."""
    DRIVING = "driving"
    """The driver holds: motion."""
    STOPPING = "stopping"
    """Zeros until the robot stands still, or another source may have it."""
    INHIBITED = "inhibited"
    """Zeros for a reason, until it is gone and the driver has released."""
    STOPPED = "stopped"
    """Zeros, then the robot's lock, until the stop is reset."""


RESTING: Final = frozenset({Phase.DISABLED, Phase.AVAILABLE})
"""There is neither a driver nor a stop: nothing is published."""


class Trigger(Enum):
    """What may change the phase."""

    ENABLE = "enable"
    """Driving was enabled."""
    DISABLE = "disable"
    """Driving was disabled."""
    LEASE = "lease"
    """A session was granted the lease, perhaps in place of another."""
    LEASE_ENDED = "lease ended"
    """The lease ended, and other sources may have the robot."""
    STOP = "stop"
    """The robot was stopped: by a person, or because its driver was lost (on_loss: hold)."""
    RESET = "reset"
    """The stop was reset."""
    INHIBIT = "inhibit"
    """There is a reason not to move."""
    CLEAR = "clear"
    """No reason is left, and the driver does not hold."""
    HOLD = "hold"
    """The driver's hold has begun."""
    RELEASE = "release"
    """The driver's hold has ended."""
    SETTLED = "settled"
    """STOPPING has lasted long enough."""


REST: Final = None
"""Target that depends on who is left: ARMED with a lease, AVAILABLE without, DISABLED if none may drive."""

_STOP: Final = {Trigger.STOP: Phase.STOPPED}

TRANSITIONS: Final[Mapping[Phase, Mapping[Trigger, Phase | None]]] = MappingProxyType(
    {
        Phase.DISABLED: {**_STOP, Trigger.ENABLE: Phase.AVAILABLE},
        Phase.AVAILABLE: {**_STOP, Trigger.DISABLE: Phase.DISABLED, Trigger.LEASE: Phase.ARMED},
        Phase.ARMED: {
            **_STOP,
            Trigger.DISABLE: Phase.STOPPING,
            Trigger.LEASE_ENDED: Phase.STOPPING,
            Trigger.INHIBIT: Phase.INHIBITED,
            Trigger.HOLD: Phase.DRIVING,
        },
        Phase.DRIVING: {
            **_STOP,
            Trigger.DISABLE: Phase.STOPPING,
            Trigger.LEASE: Phase.STOPPING,
            Trigger.LEASE_ENDED: Phase.STOPPING,
            Trigger.INHIBIT: Phase.INHIBITED,
            Trigger.RELEASE: Phase.STOPPING,
        },
        # The zeros for the others start again when the lease ends, and when another driver gets it: the ramp
        # of a release is only for the driver who has released.
        Phase.STOPPING: {
            **_STOP,
            Trigger.DISABLE: Phase.STOPPING,
            Trigger.LEASE: Phase.STOPPING,
            Trigger.LEASE_ENDED: Phase.STOPPING,
            Trigger.INHIBIT: Phase.INHIBITED,
            Trigger.HOLD: Phase.DRIVING,
            Trigger.SETTLED: REST,
        },
        Phase.INHIBITED: {
            **_STOP,
            Trigger.DISABLE: Phase.STOPPING,
            Trigger.LEASE_ENDED: Phase.STOPPING,
            Trigger.CLEAR: Phase.ARMED,
        },
        Phase.STOPPED: {Trigger.RESET: REST},
    }
)
