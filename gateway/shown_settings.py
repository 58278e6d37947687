"""The configuration as operators may see it: without secrets, topics, devices and paths."""

import json
from typing import Any, Final

from gateway.config import GatewaySettings

_HIDDEN: Final = frozenset(
    {
        "topic",
        "type",
        "field",
        "reliability",
        "durability",
        "socket",
        "disk_path",
        "credentials",
        "file",
        "client_ca",
    }
)
"""Where values come from: the contract names no topic, device or path."""
_SECRET: Final = ("secret", "token", "password", "passphrase", "private", "key", "cert")
"""Parts of names, so that a new secret is hidden as well."""


def shown_settings(settings: GatewaySettings) -> str:
    """Returns a JSON object with the keys of the configuration file, in its order."""
    return json.dumps(_shown(settings.model_dump(mode="json")), ensure_ascii=False, indent=2)


def _shown(value: Any) -> Any:
    if isinstance(value, dict):
        return {
            key: _shown(part)
            for key, part in value.items()
            if key not in _HIDDEN and not any(word in key for word in _SECRET)
        }
    if isinstance(value, list):
        return [_shown(part) for part in value]
    return value
