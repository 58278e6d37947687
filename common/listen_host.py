"""Hosts at which a program serves: what can be one. Whether it is this machine's, binding shows. Pure."""

import ipaddress
import re
from typing import Annotated, Final

from pydantic import AfterValidator

_MAX_NAME: Final = 253
"""Characters of a name (RFC 1035 2.3.4: 255 bytes on the wire)."""
_LABEL: Final = r"[A-Za-z0-9_]([A-Za-z0-9_-]{0,61}[A-Za-z0-9_])?"
"""RFC 1123 2.1; with the underscore, which names of containers have."""
_NAME: Final = re.compile(rf"{_LABEL}(\.{_LABEL})*\.?")


def _can_be_a_host(text: str) -> str:
    if not (_is_address(text) or (len(text) <= _MAX_NAME and _NAME.fullmatch(text))):
        raise ValueError("a host name or an address, 127.0.0.1 or ::1 for example")
    return text


def _is_address(text: str) -> bool:
    try:
        ipaddress.ip_address(text)
    except ValueError:
        return False
    return True


ListenHost = Annotated[str, AfterValidator(_can_be_a_host)]
"""A name or an address without a port; IPv6 without brackets."""
