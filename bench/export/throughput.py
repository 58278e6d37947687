"""How fast a recording is copied, against a bare gRPC stream of the same bytes to the same client."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from bench.export import bare_server
from bench.export.copying import Stream, copied
from bench.export.ground import ExportingRobot
from bench.processes import first_line, piped_program
from bench.progress import log
from bench.rows import FEWEST_ROUNDS, Row

ROUNDS: Final = FEWEST_ROUNDS
BAR: Final = 0.8


def rows(robot: ExportingRobot, _wanted: set[str]) -> list[Row]:
    ours, bare = [], []
    with bare_stream(robot.paths) as target:
        one_round(robot, target)  # files and code get into memory
        for number in range(ROUNDS):
            through_robot, through_nothing = one_round(robot, target)
            ours.append(through_robot)
            bare.append(through_nothing)
            log(f"export: round {number + 1}, {ours[-1]:.0f} MiB/s, bare stream {bare[-1]:.0f} MiB/s")
    return [
        Row(
            name="export.throughput",
            what="a recording copied by way of the gateway, against a bare gRPC stream of the same"
            " bytes from memory to the same client, in turns",
            unit="MiB/s",
            values=ours,
            references=bare,
            bar=BAR,
            better="higher",
        )
    ]


def one_round(robot: ExportingRobot, bare_target: str) -> tuple[float, float]:
    """Returns MiB a second of ours and of the bare stream.

    Raises:
        RuntimeError: both did not send the same number of bytes.
    """
    through_robot = copied(robot.target, robot.streams())
    through_nothing = copied(bare_target, [Stream(bare_server.METHOD, b"")])
    if through_robot.size != through_nothing.size:
        raise RuntimeError(f"{through_robot.size} bytes came, and {through_nothing.size} as reference")
    return through_robot.mib_s, through_nothing.mib_s


@contextmanager
def bare_stream(paths: Sequence[Path]) -> Iterator[str]:
    """Yields the address of a bare server of these files."""
    with piped_program("bench.export.bare_server", *map(str, paths)) as process:
        word, _, port = first_line(process).partition(" ")
        if word != "ready":
            raise RuntimeError("the bare server did not start")
        yield f"127.0.0.1:{int(port)}"
