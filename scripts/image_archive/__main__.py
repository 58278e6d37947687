"""The command line: scripts/images is its only caller."""

import argparse
import sys
import tarfile
import zlib
from datetime import UTC, datetime
from pathlib import Path

from common.errors import UserError
from image_archive.archive import write


def main() -> int:
    """Writes the archive to standard output and returns 0; prints one line and returns 1 if it can't."""
    parser = argparse.ArgumentParser(prog="image_archive", description="Writes images as one archive.")
    parser.add_argument("saved", type=Path, metavar="FILE", help="that `docker save` has written")
    parser.add_argument(
        "--created",
        type=int,
        metavar="SECONDS",
        help="since 1970: the time of the images, whose files all get one time; by default nothing changes",
    )
    options = parser.parse_args()
    created = None if options.created is None else datetime.fromtimestamp(options.created, UTC)
    try:
        write(options.saved, sys.stdout.buffer, created)
    except UserError as error:
        print(f"images: {error}", file=sys.stderr)
        return int(error.exit_code)
    except (EOFError, OSError, ValueError, tarfile.TarError, zlib.error) as error:
        print(f"images: {options.saved}: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
