"""A test that can't be ended fails alone, and the run goes on."""

import pytest

pytest_plugins = ["pytester"]

HANGS = """
import threading, time

import pytest

@pytest.fixture
def stuck():
    yield
    while True:  # deaf to what pytest-timeout raises
        try:
            time.sleep(1)
        except BaseException:
            pass

@pytest.mark.timeout(0.5)
def test_stuck(stuck):
    pass

def test_fails(stuck):
    assert False

def test_next():
    pass
"""
PASSES = "def test_passes(): pass"


def test_a_test_that_hangs_in_its_end_is_reported_and_the_others_run(pytester: pytest.Pytester) -> None:
    pytester.makeini("[pytest]\ntimeout = 30")
    pytester.makeconftest(
        """
        from tests.support import bounds
        pytest_plugins = ["tests.support.bounds", "tests.support.distribution"]
        bounds.GRACE_S = 0.5
        """
    )
    pytester.makepyfile(test_before=PASSES, test_it=HANGS, test_later=PASSES)
    ran = pytester.runpytest_subprocess("-n1", "--dist=loadscope", timeout=60)
    # The calls of the two ended, one well and one badly, before their ends did not.
    ran.assert_outcomes(passed=4, failed=3)
    for test in ("test_stuck", "test_fails"):
        ran.stdout.fnmatch_lines(f"*worker 'gw*' crashed while running *{test}*")
    ran.stderr.fnmatch_lines(["Timeout (0:00:01)!", '*test_it.py", line * in stuck'])


def test_a_failure_is_named_before_the_summary(pytester: pytest.Pytester) -> None:
    pytester.makeini("[pytest]\ntimeout = 30")
    pytester.makeconftest('pytest_plugins = ["tests.support.bounds"]')
    pytester.makepyfile(test_it="def test_wrong():\n    assert False\n")
    ran = pytester.runpytest_subprocess("-n1", timeout=60)
    ran.stdout.fnmatch_lines(["FAILED test_it.py::test_wrong (call, *", "*= FAILURES =*"])
