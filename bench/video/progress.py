"""What a benchmark says while it works."""

import sys


def tell(line: str) -> None:
    """One line on standard error."""
    print(f"bench: {line}", file=sys.stderr, flush=True)
