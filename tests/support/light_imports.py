"""A pytest plugin (`-p tests.support.light_imports`): rclpy, gi and Qt are out of reach.

Unit tests run with it, and so prove that the pure parts need none of them installed.
"""

import sys
from collections.abc import Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

HEAVY = {"rclpy", "gi", "PySide6"}


class _OutOfReach(MetaPathFinder):
    def find_spec(
        self, fullname: str, _path: Sequence[str] | None, _target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname.partition(".")[0] in HEAVY:
            raise ModuleNotFoundError(f"{fullname} is out of reach in unit tests", name=fullname)
        return None


def pytest_configure() -> None:
    """Runs before any test is collected."""
    sys.meta_path.insert(0, _OutOfReach())
