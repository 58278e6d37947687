"""Standard streams that print what their encoding lacks as "?", instead of ending the program."""

import io
import sys


def tolerate_encoding() -> None:
    """Makes both output streams replace what they can't encode, °C in an ASCII locale for example."""
    for stream in (sys.stdout, sys.stderr):
        # Not a stream that a test or a launcher has put there instead.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
