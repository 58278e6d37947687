"""What goes onto the laptop, as one text: who signs the robot's certificate, and what proves who asks.

`robotctl login` reads it. It holds a secret: it is shown once, and the robot keeps none of it.
"""

from dataclasses import dataclass, field
from typing import Final

from gateway.access.authority import Pair

_HEAD: Final = "# Robot Gateway login 1"


@dataclass(frozen=True, slots=True)
class Bundle:
    """One person's way in.

    Attributes:
        name: of the person.
        role: what they may do.
        robot: the gateway's name.
        authority: who signs the gateway's certificate (PEM).
        token: as text; empty where there is none.
        client: certificate and key, where there are some.
    """

    name: str
    role: str
    robot: str
    authority: bytes
    token: str = field(default="", repr=False)
    client: Pair | None = None

    def text(self) -> str:
        """As it is handed over."""
        lines = [_HEAD, f"robot: {self.robot}", f"name: {self.name}", f"role: {self.role}"]
        if self.token:
            lines.append(f"token: {self.token}")
        parts = ["\n".join(lines), "authority:\n" + self.authority.decode().strip()]
        if self.client:
            parts.append("certificate:\n" + self.client.certificate.decode().strip())
            parts.append("key:\n" + self.client.key.decode().strip())
        return "\n".join(parts) + "\n"
