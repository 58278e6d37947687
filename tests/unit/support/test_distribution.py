"""The list of long files is kept up: a file that has moved would begin last. Deployments start one by one."""

import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from tests.support.distribution import LONGEST, pytest_xdist_make_scheduler, unit_of

pytest_plugins = ["pytester"]

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


PACED = "import pytest, os\npytestmark = pytest.mark.gst\ndef test_{0}(): print('NICE', '{0}', os.nice(0))\n"
PLAIN = "import os\ndef test_{0}(): print('NICE', '{0}', os.nice(0))\n"


def test_the_background_yields_and_gets_nothing_that_is_paced(pytester: pytest.Pytester) -> None:
    paced, plain = [f"paced_{each}" for each in range(6)], [f"plain_{each}" for each in range(12)]
    files = {f"test_{name}": PACED.format(name) for name in paced}
    files |= {f"test_{name}": PLAIN.format(name) for name in plain}
    ran = run(pytester, files, workers=4)
    ran.assert_outcomes(passed=18)
    nice = {line.split()[1]: int(line.split()[2]) for line in ran.outlines if line.startswith("NICE")}
    own = os.nice(0)
    assert {nice[name] for name in paced} == {own}
    # 19 is the largest value there is: this run may be a background one itself.
    assert min(own + 10, 19) in {nice[name] for name in plain}


@pytest.mark.parametrize("template", [PACED, PLAIN])
def test_files_of_one_kind_are_run_all_the_same(pytester: pytest.Pytester, template: str) -> None:
    ran = run(pytester, {f"test_{each}": template.format(each) for each in range(5)}, workers=4)
    ran.assert_outcomes(passed=5)


def test_a_worker_that_replaces_one_of_the_foreground_is_in_the_foreground(pytester: pytest.Pytester) -> None:
    crashing = "import os, pytest\npytestmark = pytest.mark.gst\ndef test_{0}(): os._exit(1)\n"
    files = {f"test_crash_{each}": crashing.format(each) for each in range(3)}
    files |= {f"test_paced_{each}": PACED.format(each) for each in range(3)}
    files |= {f"test_plain_{each}": PLAIN.format(each) for each in range(3)}
    ran = run(pytester, files, workers=3)
    ran.assert_outcomes(passed=6, failed=3)


def test_what_a_crashed_worker_was_to_run_is_run_by_another(tmp_path: Path) -> None:
    """The worker's end is noticed only after more was to be sent to it."""
    first, second = Worker(), Worker()
    config: Any = SimpleNamespace(
        option=SimpleNamespace(loadscopereorder=False), rootpath=tmp_path, getvalue=lambda _: ["popen"] * 2
    )
    scheduler: Any = pytest_xdist_make_scheduler(config, None)
    tests = [f"test_{each}.py::test" for each in range(6)]
    for each in range(6):
        (tmp_path / f"test_{each}.py").touch()
    for worker in (first, second):
        scheduler.add_node(worker)
        scheduler.add_node_collection(worker, list(tests))
    first.crashed = True
    scheduler.schedule()
    assert scheduler.remove_node(first) == tests[0]
    while second.sent:
        scheduler.mark_test_complete(second, second.sent.pop(0))
    assert sorted(second.ran) == [1, 2, 3, 4, 5]


class Worker:
    """One of pytest-xdist's workers, as its scheduler sees it."""

    def __init__(self) -> None:
        self.workerinput = {"robot_gateway_background": False}
        self.shutting_down = False
        self.crashed = False
        self.sent: list[int] = []
        self.ran: list[int] = []
        self.gateway = SimpleNamespace(id="gw")

    def send_runtest_some(self, indices: list[int]) -> None:
        if self.crashed:
            raise OSError("cannot send (already closed?)")
        self.sent += indices
        self.ran += indices

    def shutdown(self) -> None:
        self.shutting_down = True


def run(pytester: pytest.Pytester, files: dict[str, str], workers: int) -> pytest.RunResult:
    pytester.makeini("[pytest]\nmarkers = gst")
    pytester.makeconftest('pytest_plugins = ["tests.support.distribution"]')
    pytester.makepyfile(**files)
    return pytester.runpytest_subprocess(f"-n{workers}", "--dist=loadscope", "-rP", timeout=60)
