"""Logging for all programs: one line per event, on standard error."""

import logging
import sys

_FORMAT = "%(asctime)s %(levelname)-7s %(name)s: %(message)s"


def configure(level: str) -> None:
    """Sends all log records from `level` ("debug", "info", "warning", "error") up to standard error."""
    logging.basicConfig(level=level.upper(), format=_FORMAT, stream=sys.stderr, force=True)
    # The debug chatter of asyncio and gRPC says nothing about the robot.
    for name in ("asyncio", "grpc"):
        logging.getLogger(name).setLevel(logging.WARNING)
