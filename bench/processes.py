"""Programs that a benchmark measures from outside."""

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import psutil


@contextmanager
def piped_program(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """`python -m ARGUMENTS` with pipes; ends when the block ends, by its standard input closing."""
    with subprocess.Popen(
        [sys.executable, "-m", *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin
        try:
            yield process
        finally:
            process.stdin.close()
            try:
                process.wait(10)
            except subprocess.TimeoutExpired:
                process.kill()


@contextmanager
def program(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """The same, from its "ready" on."""
    with piped_program(*arguments) as process:
        line = first_line(process)
        if "ready" not in line:
            raise RuntimeError(f"{arguments[0]} did not start: {line!r}")
        yield process


def first_line(process: subprocess.Popen[str]) -> str:
    """Returns the first line that a program prints."""
    assert process.stdout
    return process.stdout.readline()


@dataclass(frozen=True, slots=True)
class CpuShare:
    """CPU time in a window, in percent of one core."""

    middleware: float
    """Of the threads that Fast DDS made: receiving, discovery, timers."""
    own: float
    """Of all others."""

    @property
    def whole(self) -> float:
        """Of the whole process."""
        return self.middleware + self.own


def cpu_share(pid: int, window_s: float) -> CpuShare:
    """What a process needs over the coming `window_s`. The scheduler counts in ns, not in ticks of 10 ms."""
    before, started = _cpu_times_ns(pid), time.monotonic()
    time.sleep(window_s)
    after, passed_s = _cpu_times_ns(pid), time.monotonic() - started
    middleware = own = 0.0
    for thread, (name, spent_ns) in after.items():
        percent = (spent_ns - before.get(thread, (name, 0))[1]) / (passed_s * 1e7)
        if name.startswith("dds."):
            middleware += percent
        else:
            own += percent
    return CpuShare(middleware, own)


def cpu_seconds(pid: int) -> float:
    """Returns the CPU time that a process has needed so far, in s."""
    return sum(spent_ns for _, spent_ns in _cpu_times_ns(pid).values()) / 1e9


def _cpu_times_ns(pid: int) -> dict[str, tuple[str, int]]:
    """Name and CPU time so far of every thread."""
    times = {}
    for task in Path(f"/proc/{pid}/task").iterdir():
        with suppress(FileNotFoundError, ProcessLookupError):  # a thread that ends meanwhile
            spent_ns = int((task / "schedstat").read_text().split()[0])
            times[task.name] = ((task / "comm").read_text().strip(), spent_ns)
    return times


def resident_mib(pid: int) -> float:
    """Memory of a process that is in RAM, in MiB."""
    return float(psutil.Process(pid).memory_info().rss) / 2**20


def shared_mib(pid: int) -> float:
    """The part of `resident_mib` that other processes may have as well, in MiB: files, code among them."""
    return float(psutil.Process(pid).memory_info().shared) / 2**20
