"""Logging that never blocks."""

import logging
import os

from drive.log_thread import LogThread


def record(text: str) -> logging.LogRecord:
    return logging.LogRecord("drive", logging.INFO, __file__, 1, text, None, None)


def test_a_reader_that_stands_still_blocks_no_writer() -> None:
    reader, writer = os.pipe()
    try:
        handler = LogThread(logging.Formatter("%(message)s"), writer)
        for number in range(5000):
            handler.emit(record(f"{number} {'x' * 100}"))
        text = b""
        while b"lines were dropped" not in text:
            text += os.read(reader, 65536)
            handler.emit(record("last"))
        while handler.drain(0.02):
            text += os.read(reader, 65536)
        assert b"lines were dropped: nothing read them\n" in text
        handler.close()
    finally:
        os.close(reader)
        os.close(writer)
