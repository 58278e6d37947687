"""The list of long files is kept up: a file that has moved would begin last. Deployments start one by one."""

from pathlib import Path

import pytest

from tests.support.distribution import LONGEST, unit_of

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("file", LONGEST)
def test_each_file_that_begins_early_exists(file: str) -> None:
    assert (ROOT / file).is_file()


def test_what_deploys_the_system_is_two_units_and_all_else_a_unit_by_itself() -> None:
    together: dict[str, list[Path]] = {}
    for path in (ROOT / "tests").rglob("test_*.py"):
        together.setdefault(unit_of(str(path.relative_to(ROOT))), []).append(path)
    shared = [members for members in together.values() if len(members) > 1]
    assert len(shared) == 2
    apart = {path for members in shared for path in members}
    deploying = {
        path
        for path in (ROOT / "tests/e2e/containers").glob("test_*.py")
        if "tests.e2e.containers.deployment" in path.read_text(encoding="utf-8")
    }
    assert deploying <= apart
    assert ROOT / "tests/e2e/containers/test_upgrade_robot.py" not in apart
