"""Besieges a guarded gateway that runs on this machine, a compose deployment for example.

python -m bench.siege --target 127.0.0.1:50051 --pid PID
    --credentials "docker compose run --rm -T credentials"

Its callers keep their own addresses only if its container uses the host's network, as compose.yaml has it.
The credentials that it adds, all named siege-..., are revoked at its end. PID is that of the gateway program
itself: pgrep -f "robot-gateway serve".
"""

import argparse
import sys

from rich.console import Console

from bench import report
from bench.siege.ground import CommandKeeper, Ground
from bench.siege.judgement import measured
from bench.siege.size import FULL


def main() -> int:
    """Ends 0 when every promise is kept, 1 when one is not."""
    parser = argparse.ArgumentParser(
        prog="python -m bench.siege",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--target", required=True, metavar="HOST:PORT", help="an IPv4 address of this machine"
    )
    parser.add_argument(
        "--pid", required=True, type=int, help="of the gateway program, not of its container's init"
    )
    parser.add_argument(
        "--credentials", required=True, metavar="COMMAND", help="what stands before 'add NAME --role ROLE'"
    )
    parser.add_argument("--metrics-port", type=int, help="for siege.closed, where the gateway serves metrics")
    given = parser.parse_args()
    host, _, port = given.target.rpartition(":")
    ground = Ground(host, int(port), CommandKeeper(given.credentials), given.pid, given.metrics_port)
    rows = measured(ground, FULL)
    Console(width=None if sys.stdout.isatty() else 200).print(report.table(rows))
    return 0 if all(row.ok for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
