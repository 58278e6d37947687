"""The address of a robot's gateway."""

import re
from typing import Final

from common.errors import ExitCode, UserError

DEFAULT_TARGET: Final = "127.0.0.1:50051"
DEFAULT_PORT: Final = 50051

# A name or an IPv4 address, or an IPv6 address in brackets (RFC 3986 3.2.2); then an optional port.
_FORM: Final = re.compile(r"(?P<host>\[[0-9A-Fa-f:.%\w]+\]|[^\s:/\[\]]+)(?::(?P<port>\d{1,5}))?")
_HIGHEST_PORT: Final = 65535


def parse_target(text: str) -> str:
    """Returns HOST:PORT for HOST or HOST:PORT. IPv6 addresses are in brackets.

    Raises:
        UserError: It is neither (a wrong command line).
    """
    match = _FORM.fullmatch(text.strip())
    port = int(match["port"] or DEFAULT_PORT) if match else 0
    if not match or not 0 < port <= _HIGHEST_PORT:
        raise UserError(
            f"'{text}' is not the address of a gateway",
            f"Write HOST or HOST:PORT, {DEFAULT_TARGET} or robot.local:50051 or [fe80::1]:50051 for example",
            exit_code=ExitCode.USAGE,
        )
    return f"{match['host']}:{port}"
