"""The login bundle: one text with all that a laptop needs to connect, which `robotctl login` reads.

It contains a secret. It is output once, and the robot keeps no copy.
"""

from dataclasses import dataclass, field
from typing import Final

from common.ca import KeyPair

_HEADER: Final = "# Robot Gateway login 1"


@dataclass(frozen=True, slots=True)
class LoginBundle:
    """The login of one person or program.

    Attributes:
        name: of the person or program.
        role: by name.
        robot: name of the gateway.
        ca_certificate: of the authority that signs the gateway's certificate (PEM).
        token: bearer token; empty if there is none.
        client: client certificate and key, if any.
    """

    name: str
    role: str
    robot: str
    ca_certificate: bytes
    token: str = field(default="", repr=False)
    client: KeyPair | None = None

    def text(self) -> str:
        """Encodes the bundle: header, "key: value" lines, then the PEM sections."""
        lines = [_HEADER, f"robot: {self.robot}", f"name: {self.name}", f"role: {self.role}"]
        if self.token:
            lines.append(f"token: {self.token}")
        lines += ["authority:", self.ca_certificate.decode().strip()]
        if self.client:
            lines += ["certificate:", self.client.certificate.decode().strip()]
            lines += ["key:", self.client.key.decode().strip()]
        return "\n".join(lines) + "\n"
