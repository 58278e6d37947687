"""The version of what is installed."""

from importlib.metadata import PackageNotFoundError, version


def project_version() -> str:
    """MAJOR.MINOR.PATCH of the installed project, "0.0.0" in a tree that was never installed."""
    try:
        return version("robot-gateway")
    except PackageNotFoundError:
        return "0.0.0"
