"""What somebody may do: three roles, each of which may do what the ones before it may."""

from enum import Enum


class Role(Enum):
    """The order of the members is the order of what they may do."""

    VIEWER = "viewer"
    """Looks at everything, the video included, and changes nothing."""
    OPERATOR = "operator"
    """Switches what an operator switches."""
    ADMIN = "admin"
    """Sees and manages who else is there."""

    def may(self, needed: "Role") -> bool:
        """Whether this role is enough for what needs that one."""
        return _RANKS[self] >= _RANKS[needed]


_RANKS = {role: rank for rank, role in enumerate(Role)}
