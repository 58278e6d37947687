"""The configuration as operators may see it: without secrets, and without what is the robot's own affair."""

import json
from typing import Any, Final

from gateway.config import GatewaySettings

# Where values come from, devices and paths: the contract names none of them. Secrets are listed by what their
# names hold, so that a new one is hidden before anybody thinks of it.
_OWN_AFFAIR: Final = frozenset(
    {"topic", "type", "reliability", "durability", "socket", "disk_path", "credentials", "file", "client_ca"}
)
_SECRET: Final = ("secret", "token", "password", "passphrase", "private", "key", "cert")


def shown_settings(settings: GatewaySettings) -> str:
    """A JSON object with the keys of the configuration file, in its order."""
    return json.dumps(_shown(settings.model_dump(mode="json")), ensure_ascii=False, indent=2)


def _shown(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _shown(part) for key, part in value.items() if _may_be_shown(key)}
    if isinstance(value, list):
        return [_shown(part) for part in value]
    return value


def _may_be_shown(key: str) -> bool:
    return key not in _OWN_AFFAIR and not any(word in key for word in _SECRET)
