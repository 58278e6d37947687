"""Settings of uploads: the section `uploads` of the bridge's configuration."""

from pathlib import Path
from typing import Annotated, Final, Literal, Self
from zoneinfo import ZoneInfo

from pydantic import AfterValidator, Field, model_validator

from bridge.config.zones import checked_name
from common.config import Section
from common.text_form import Form
from fleet.servers import THIS_MACHINE

_TIME: Final = r"([01][0-9]|2[0-3]):[0-5][0-9]"
_HOURS: Final = Form(f"{_TIME}-{_TIME}", "two times of the day, 22:00-06:00 for example")
_INTERFACE: Final = Form(
    "[A-Za-z0-9_.*-]{1,15}", "a network interface, or several with *, wlan0 or wl* for example"
)
_PLACE: Final = Form(
    r"[a-z0-9]([a-z0-9.-]{0,251}[a-z0-9])?(:[0-9]{1,5})?(/[A-Za-z0-9_-][A-Za-z0-9._-]{0,62}){0,4}",
    "HOST, HOST:PORT or HOST/BUCKET without https://, store.example:9000 for example",
)
_MOST: Final = 16


class UploadSettings(Section):
    """Which recordings are copied to the fleet's store, and when."""

    rule: Literal["none", "incidents", "pinned", "all"] = "none"
    """What is copied by itself once it has ended: nothing, incidents, these and pinned recordings, or all."""
    max_bytes_per_s: int = Field(default=0, ge=0)
    """0: no limit. Otherwise at least 64 KiB, so that a part is sent while its URL is valid."""
    interfaces: tuple[Annotated[str, _INTERFACE], ...] = Field(default=(), max_length=_MOST)
    """Network interfaces through which the store may be reached, "*" for any characters. Empty: all."""
    hours: tuple[Annotated[str, _HOURS], ...] = Field(default=(), max_length=_MOST)
    """When, "22:00-06:00" for example, as the clock on the wall shows it. Empty: at all times."""
    time_zone: Annotated[str, Field(max_length=64), AfterValidator(checked_name)] | None = None
    """The zone of that clock, by its IANA name, Europe/Berlin for example. None: that of the machine; a
    container has none, which means UTC."""
    only_while_charging: bool = False
    store_hosts: tuple[Annotated[str, _PLACE], ...] = Field(default=(), max_length=_MOST)
    """HOST or HOST:PORT of the fleet's store, with /BUCKET where others have buckets there. Recordings are
    sent nowhere else, whatever URL the hub returns. Empty: nothing can be uploaded."""
    ca: Path | None = None
    """Certificate authority of the store. None: those of the system."""
    insecure_store: bool = False
    """Accepts a store without TLS on this machine, for tests."""

    @property
    def zone(self) -> ZoneInfo | None:
        """The zone of the hours; None: that of the machine."""
        return None if self.time_zone is None else ZoneInfo(self.time_zone)

    @property
    def hosts(self) -> tuple[str, ...]:
        """HOST or HOST:PORT of each place where recordings may be sent."""
        return tuple(place.partition("/")[0] for place in self.store_hosts)

    def permits(self, host: str, path: str) -> bool:
        """Returns whether recordings may be sent there; the path is absolute, and leads nowhere but down."""
        for place in self.store_hosts:
            its_host, _, bucket = place.partition("/")
            if host == its_host and (not bucket or path.startswith(f"/{bucket}/")):
                return True
        return False

    @model_validator(mode="after")
    def _is_possible(self) -> Self:
        if 0 < self.max_bytes_per_s < 65_536:
            raise ValueError("max_bytes_per_s must be 0 or at least 65536")
        names = {host.partition(":")[0] for host in self.hosts}
        if self.insecure_store and not names <= THIS_MACHINE:
            raise ValueError("insecure_store is for stores on 127.0.0.1 alone")
        return self
