"""Which start of the computer this is."""

from pathlib import Path

from gateway.platform.files import text


def boot_id(proc: Path = Path("/proc")) -> str:
    """Another one after each start of the computer; empty when it tells none."""
    return text(proc / "sys/kernel/random/boot_id") or ""
