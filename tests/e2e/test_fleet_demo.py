"""scripts/fleet-demo as a user types it: three robots, a hub of three nodes, a store, nothing left."""

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

STEPS = ["hub", "robots", "event", "node killed", "snapshot", "upload", "get", "revoke", "stop"]

pytestmark = [pytest.mark.ros, pytest.mark.timed, pytest.mark.alone, pytest.mark.timeout(300)]


def test_the_main_job(tmp_path: Path) -> None:
    done = subprocess.run(
        [ROOT / "scripts/fleet-demo", "--check"],
        env={**os.environ, "TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=280,
        check=False,
    )
    said = f"{done.stdout}\n{done.stderr}"
    assert done.returncode == 0, said
    steps = [line.split(":")[0].split(" s  ")[-1] for line in done.stdout.splitlines()]
    assert steps == [*STEPS, "main job"], said
    assert not list(tmp_path.iterdir()), "nothing is left behind"
