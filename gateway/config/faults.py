"""`faults`: the thresholds that the robot's owner tunes."""

from dataclasses import fields
from typing import Annotated, Final, Self

from pydantic import Field, model_validator

from common.config import Section
from common.text_form import Form
from gateway.status.faults.platform import PlatformLimits
from gateway.status.limit import Limit

_FAULT_ID: Final = Form(
    r"[a-z0-9_]+(\.[a-z0-9_]+)*", "a fault's id, or its beginning up to a dot, odometry.stale for example"
)


class _LimitSettings(Section):
    raise_at: float = Field(allow_inf_nan=False)
    clear_at: float = Field(allow_inf_nan=False)
    """On the good side of `raise_at` (hysteresis), so that noise at the limit raises no series of faults."""

    def limit(self) -> Limit:
        """Returns the limit in the form that the fault rules take."""
        return Limit(self.raise_at, self.clear_at)


class UpperLimit(_LimitSettings):
    """A limit for values that must not become large."""

    @model_validator(mode="after")
    def _leave_a_gap(self) -> Self:
        if self.clear_at >= self.raise_at:
            raise ValueError(f"clear_at ({self.clear_at:g}) must be below raise_at ({self.raise_at:g})")
        return self


class LowerLimit(_LimitSettings):
    """A limit for values that must not become small."""

    @model_validator(mode="after")
    def _leave_a_gap(self) -> Self:
        if self.clear_at <= self.raise_at:
            raise ValueError(f"clear_at ({self.clear_at:g}) must be above raise_at ({self.raise_at:g})")
        return self


class FaultSettings(Section):
    """When a fault is raised and cleared, and how long it is kept."""

    startup_grace_ms: int = Field(default=5000, ge=0, le=600_000)
    """How long after the start a source may be missing: the robot's programs take their time to start."""
    clear_after_ms: int = Field(default=2000, ge=0, le=600_000)
    """How long a condition must be absent before its fault is cleared."""
    keep_cleared_ms: int = Field(default=60_000, ge=0, le=86_400_000)
    """How long a cleared fault stays in the status."""
    ignored_by_health: tuple[Annotated[str, _FAULT_ID], ...] = ("preview", "cloud")
    """Errors that don't degrade the robot's health: fault ids, or their beginnings up to a dot."""
    temperature_c: UpperLimit = UpperLimit(raise_at=85, clear_at=80)
    memory_percent: UpperLimit = UpperLimit(raise_at=92, clear_at=88)
    disk_percent: UpperLimit = UpperLimit(raise_at=95, clear_at=93)
    battery_percent: LowerLimit = LowerLimit(raise_at=20, clear_at=25)
    """Charge of the robot's battery and of the computer's."""
    wifi_signal_dbm: LowerLimit = LowerLimit(raise_at=-75, clear_at=-70)
    tilt_deg: UpperLimit = UpperLimit(raise_at=30, clear_at=25)
    """Angle between the robot's vertical axis and the world's, of a source of kind orientation."""
    expiry_days: float = Field(default=14, ge=0, le=3650)
    """How long before its end of validity a certificate is a fault."""
    hub_offline_s: float = Field(default=600, ge=0, le=31_536_000)
    """How long the fleet's hub may be away without a fault: some places of a robot have no network."""

    def platform_limits(self) -> PlatformLimits:
        """Returns the limits in the form that the fault rules take."""
        names = (field.name for field in fields(PlatformLimits))
        return PlatformLimits(**{name: getattr(self, name).limit() for name in names})
