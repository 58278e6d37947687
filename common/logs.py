"""Logging of all programs: one line per record on standard error, as text or as JSON.

A record may quote what comes from outside, which must not forge another line or steer a terminal.
"""

import json
import logging
import sys
from datetime import UTC, datetime
from typing import Final, Literal, TypeAlias

from common import request_id
from common.printable import escaped, printable, printable_lines

Format: TypeAlias = Literal["human", "json"]

_HUMAN: Final = "%(asctime)s %(levelname)-7s %(name)s: %(message)s%(of_request)s"


def configure(level: str, form: Format = "human") -> None:
    """Sends records of at least `level` ("debug", "info", "warning", "error") to standard error."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(_Json() if form == "json" else _Human(_HUMAN))
    handler.addFilter(_add_request_id)
    logging.basicConfig(level=level.upper(), handlers=[handler], force=True)
    # Debug records of asyncio and gRPC are frequent and say nothing about the robot.
    for name in ("asyncio", "grpc"):
        logging.getLogger(name).setLevel(logging.WARNING)


def _add_request_id(record: logging.LogRecord) -> bool:
    """Adds the id of the current request to the record; never drops one."""
    of = request_id.current()
    record.__dict__.update(request_id=of, of_request=f" [request {of}]" if of else "")
    return True


class _Human(logging.Formatter):
    """Formats a record as a line of text; a traceback follows in lines of its own."""

    def format(self, record: logging.LogRecord) -> str:
        return printable_lines(super().format(record))

    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802  # logging's own name
        return printable(super().formatMessage(record))


class _Json(logging.Formatter):
    """Formats a record as JSON: time (UTC), level, logger, message; request_id and exception if any."""

    def format(self, record: logging.LogRecord) -> str:
        line = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "logger": record.name,
            "message": record.getMessage(),
        }
        if of_request := getattr(record, "request_id", ""):
            line["request_id"] = of_request
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return escaped(json.dumps(line, ensure_ascii=False))
