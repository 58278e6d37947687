"""What a module of tests leaves behind fails it."""

import pytest

pytest_plugins = ["pytester"]

LEAVES = {
    "process": "subprocess.Popen(['sleep', '5'], start_new_session=True)",
    "thread": "threading.Thread(target=threading.Event().wait, args=(30,), daemon=True).start()",
    "socket": "KEPT.append(socket.create_server(('127.0.0.1', 0)))",
    "file": "KEPT.append(open(__file__))",
    "unnamed descriptor": "KEPT.extend(os.pipe() for _ in range(30))",
}


@pytest.mark.parametrize("kind", LEAVES)
def test_a_module_that_leaves_something_fails(pytester: pytest.Pytester, kind: str) -> None:
    ran = run(pytester, LEAVES[kind])
    ran.assert_outcomes(passed=1, errors=1)
    ran.stdout.fnmatch_lines([f"*left behind: {kind}*"])


def test_a_module_that_tidies_up_passes(pytester: pytest.Pytester) -> None:
    run(pytester, "subprocess.run(['true'])").assert_outcomes(passed=1)


def run(pytester: pytest.Pytester, body: str) -> pytest.RunResult:
    pytester.makeconftest("from tests.support import leftovers; leftovers.GONE_WITHIN_S = 0.5")
    pytester.makepyfile(
        f"""
        import os, socket, subprocess, threading
        KEPT = []

        def test_it():
            {body}
        """
    )
    # In a process of its own: what is left behind ends with it, or by its own time.
    return pytester.runpytest_subprocess("-p", "tests.support.leftovers", "-p", "no:cacheprovider")
