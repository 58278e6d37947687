"""Token and certificates of a client, and the certificate authority of the robot. Knows no gRPC."""

from dataclasses import dataclass, field
from typing import Final

from common.addresses import is_loopback
from common.errors import ExitCode, UserError

_TOKEN_HEADER: Final = "authorization"  # noqa: S105  # a name


@dataclass(frozen=True, slots=True, kw_only=True)
class Credentials:
    """Credentials for one robot; None for those that it does not require. Secrets are not in the `repr`.

    Args:
        ca_certificate: Certificate of the authority that signed the gateway's certificate (PEM); with it the
            connection is encrypted.
        client_certificate: This client's certificate (PEM).
        client_key: Its private key (PEM).
        token: Bearer token, without white space around it.
    """

    ca_certificate: bytes | None = None
    client_certificate: bytes | None = None
    client_key: bytes | None = field(default=None, repr=False)
    token: str | None = field(default=None, repr=False)

    def metadata(self) -> tuple[tuple[str, str], ...]:
        """Returns the metadata of every call (RFC 6750 2.1)."""
        return ((_TOKEN_HEADER, f"Bearer {self.token}"),) if self.token else ()

    def encrypts(self, target: str) -> bool:
        """Returns whether the connection is encrypted; False for plaintext.

        Args:
            target: HOST:PORT of the gateway.

        Raises:
            UserError: A secret would be sent over the network unencrypted.
        """
        if self.ca_certificate is not None:
            return True
        if self.client_certificate is not None:
            raise UserError(
                "a client certificate needs the robot's CA certificate beside it",
                "Store this robot's login: robotctl login NAME HOST:PORT FILE",
                exit_code=ExitCode.USAGE,
            )
        if self.token is not None and not is_loopback(target.rpartition(":")[0]):
            raise UserError(
                f"the token would be sent to {target} in the clear",
                "Store the robot's login (robotctl login NAME HOST:PORT FILE), which has its CA certificate, "
                "or use a tunnel to 127.0.0.1",
                exit_code=ExitCode.USAGE,
            )
        return False
