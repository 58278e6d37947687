"""What a benchmark reports while it runs."""

import sys


def log(line: str) -> None:
    """Writes one line to standard error."""
    print(f"bench: {line}", file=sys.stderr, flush=True)
