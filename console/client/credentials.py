"""What proves to a robot who asks, and what proves to the client that it is that robot."""

import ipaddress
from dataclasses import dataclass, field
from typing import Final

import grpc

from common.errors import ExitCode, UserError

_TOKEN_HEADER: Final = "authorization"


@dataclass(frozen=True, slots=True, kw_only=True)
class Credentials:
    """The contents of a robot's files; None for what there is not. Secrets are not in the `repr`.

    Args:
        ca_certificate: who signed the gateway's certificate (PEM); with it the connection is encrypted.
        client_certificate: PEM.
        client_key: PEM.
        token: without white space around it.
    """

    ca_certificate: bytes | None = None
    client_certificate: bytes | None = None
    client_key: bytes | None = field(default=None, repr=False)
    token: str | None = field(default=None, repr=False)

    def metadata(self) -> tuple[tuple[str, str], ...]:
        """What every call carries."""
        return ((_TOKEN_HEADER, f"Bearer {self.token}"),) if self.token else ()

    def channel_credentials(self, target: str) -> grpc.ChannelCredentials | None:
        """What the connection is encrypted with; None for plaintext.

        Args:
            target: HOST:PORT of the gateway.

        Raises:
            UserError: they would be sent where others can read them.
        """
        if self.ca_certificate is not None:
            return grpc.ssl_channel_credentials(self.ca_certificate, self.client_key, self.client_certificate)
        if self.client_certificate is not None:
            raise UserError(
                "a client certificate needs the robot's CA certificate beside it",
                "Type: robotctl login, with what the robot's keeper gave you",
                exit_code=ExitCode.USAGE,
            )
        if self.token is not None and not _is_loopback(target):
            raise UserError(
                f"the token would go to {target} in the clear",
                "Name the robot's CA certificate, too (robotctl login), or use a tunnel to 127.0.0.1",
                exit_code=ExitCode.USAGE,
            )
        return None


NO_CREDENTIALS: Final = Credentials()


def _is_loopback(target: str) -> bool:
    host = target.rpartition(":")[0].strip("[]")
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
