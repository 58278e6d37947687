"""Which start of the computer this is: what instants of CLOCK_MONOTONIC belong to."""

from pathlib import Path


def boot_id(proc: Path = Path("/proc")) -> str:
    """Returns the kernel's random boot ID (random(4)); empty if unavailable."""
    try:
        return (proc / "sys/kernel/random/boot_id").read_text(encoding="ascii", errors="replace").strip()
    except OSError:
        return ""
