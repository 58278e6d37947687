"""scripts/images without an engine: what it refuses."""

import os
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]


def scripts_images(*words: str | Path, **variables: str) -> subprocess.CompletedProcess[str]:
    kept = {name: value for name, value in os.environ.items() if name not in ("ALLOW_STAND_INS", "ROS")}
    return subprocess.run(
        [ROOT / "scripts" / "images", *words],
        capture_output=True,
        text=True,
        timeout=30,
        check=False,
        env={**kept, **variables},
    )


@pytest.mark.parametrize(
    ("words", "variables"), [(["--ros", "wheels"], {}), ([], {"ROS": "wheels"})], ids=["option", "variable"]
)
def test_images_with_stand_ins_are_for_no_robot(words: list[str], variables: dict[str, str]) -> None:
    refused = scripts_images("build", *words, **variables)
    assert refused.returncode == 1
    assert "--ros packages" in refused.stderr
    assert "ALLOW_STAND_INS=1" in refused.stderr
