"""Each target in a process of its own: libFuzzer ends it when it is done, or when it found something.

python -m fuzz.worker DIRECTORY RUNS SEED TARGET...  tries RUNS inputs of each; files in DIRECTORY/TARGET
python -m fuzz.worker TARGET FILE                    tries one input again
python -m fuzz.worker --list                         names the targets

The same SEED tries the same inputs; with 0 each run tries others.
"""

import os
import sys
import time
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Final

import atheris

from fuzz import OUTPUT

OURS: Final = [
    "bridge",
    "common",
    "console",
    "drive",
    "fleet",
    "gateway",
    "hub",
    "preview",
    "recorder",
    "tap",
]
"""Packages whose lines guide the fuzzer (a test looks for all that the targets import)."""
_LONGEST_INPUT: Final = 4096
_DEADLINE_S: Final = 10
"""For one input: what takes longer hangs."""
_MEMORY_MIB: Final = 1024


def main(arguments: list[str]) -> None:
    """Returns only when it lists."""
    if arguments == ["--list"]:
        _list()
        return
    with atheris.instrument_imports(include=OURS):
        from fuzz import seeds  # noqa: PLC0415
        from fuzz.targets import TARGETS  # noqa: PLC0415
    if arguments[1].isdecimal():
        directory, runs, seed, *names = arguments
        options = [f"-runs={int(runs)}", f"-seed={int(seed)}"]
        for name in names:
            began_s = time.monotonic()
            code = _in_a_copy(partial(_try, TARGETS[name], seeds.of(name), Path(directory) / name, options))
            print(name, code, time.monotonic() - began_s, flush=True)
    else:
        name, file = arguments
        _fuzz(TARGETS[name], [file])


def _list() -> None:
    # Nothing is tried, so that nothing is instrumented: that takes longer than the import.
    from fuzz.targets import TARGETS  # noqa: PLC0415

    print(*TARGETS)


def _in_a_copy(work: Callable[[], None]) -> int:
    """Returns the exit code of a copy of this process that does the work, which does not return.

    A copy has everything imported and instrumented, which takes longer than a short run. It must end as any
    process does: libFuzzer keeps the input that has ended it in a handler of exit(3).
    """
    pid = os.fork()
    if not pid:
        work()
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def _try(target: Callable[[bytes], None], good: Iterable[bytes], directory: Path, options: list[str]) -> None:
    """Does not return; prints to a file in the directory."""
    corpus = directory / "corpus"
    corpus.mkdir(parents=True)
    for index, seed in enumerate(good):
        (corpus / f"seed-{index}").write_bytes(seed)
    with (directory / OUTPUT).open("wb") as output:
        for stream in (sys.stdout, sys.stderr):
            os.dup2(output.fileno(), stream.fileno())
    _fuzz(target, [*options, "-print_final_stats=1", f"-artifact_prefix={directory}/", str(corpus)])


def _fuzz(target: Callable[[bytes], None], options: list[str]) -> None:
    """Does not return."""
    limits = [f"-timeout={_DEADLINE_S}", f"-rss_limit_mb={_MEMORY_MIB}", f"-max_len={_LONGEST_INPUT}"]
    atheris.Setup([sys.argv[0], *limits, *options], target)
    atheris.Fuzz()


if __name__ == "__main__":
    main(sys.argv[1:])
