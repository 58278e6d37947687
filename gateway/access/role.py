"""Roles of callers, ordered: each includes the permissions of those before it."""

from enum import Enum


class Role(Enum):
    """A role; the order of the members is the order of their permissions."""

    VIEWER = "viewer"
    """Reads everything, including the video."""
    OPERATOR = "operator"
    """Also controls the robot."""
    ADMIN = "admin"
    """Also manages the access of others."""

    def may(self, needed: "Role") -> bool:
        """Returns whether this role includes the permissions of `needed`."""
        return _RANKS[self] >= _RANKS[needed]


_RANKS = {role: rank for rank, role in enumerate(Role)}
