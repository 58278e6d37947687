"""robotctl's commands against a gateway: what goes where, how it ends, what scripts get."""

import json
import os
import signal
import subprocess
import time
from pathlib import Path

import grpc
import pytest

from omniseer.gateway.v1 import preview_pb2
from omniseer.gateway.v1 import states_pb2 as states
from tests.support.bad_links import black_hole
from tests.support.gateway_double import GatewayDouble
from tests.support.robotctl import (
    ENDS_WITHIN_S,
    ROBOTCTL,
    environment,
    only_line,
    robotctl,
    robotctl_in_time,
)

KNOWN_WITHIN_S = 3.0
START_OF_PYTHON_S = 3.0
"""On a machine that does other things as well; unloaded it is 0.3 s."""


def test_status_for_people(target: str) -> None:
    ended = robotctl("--target", target, "status")
    assert (ended.returncode, ended.stderr) == (0, "")
    for part in ("lab-1", target, "OK", "robot healthy", "0.50 m/s", "DISABLED"):
        assert part in ended.stdout
    assert "\x1b" not in ended.stdout, "no colours in a pipe"


def test_the_target_may_stand_anywhere(target: str) -> None:
    for words, extra in (
        (("--target", target, "status"), {}),
        (("status", "--target", target), {}),
        (("status",), {"ROBOTCTL_TARGET": target}),
        (("--target", "127.0.0.1:1", "status", "--target", target), {}),
        (("status", "--target", target), {"ROBOTCTL_TARGET": "127.0.0.1:1"}),
    ):
        assert robotctl(*words, **extra).returncode == 0, words


def test_json_may_stand_anywhere(target: str) -> None:
    for words in (("--json", "status"), ("status", "--json")):
        assert json.loads(robotctl("--target", target, *words).stdout)["health"]["state"] == "ok"


def test_overlay_for_people_and_scripts(target: str, double: GatewayDouble) -> None:
    double.overlay.detections.available = True
    double.overlay.detections.detections.add(class_name="person", score=0.5)
    double.overlay.events.add(sequence=1, message="preview running")
    shown = robotctl("overlay", "--target", target)
    assert "person" in shown.stdout
    assert "preview running" in shown.stdout
    document = json.loads(robotctl("overlay", "--target", target, "--json").stdout)
    assert document["detections"]["items"][0]["class_name"] == "person"
    assert document["status"]["gateway_name"] == "lab-1"


def test_preview_on_waits_until_it_runs(target: str, double: GatewayDouble) -> None:
    double.preview_becomes.extend([states.PREVIEW_STARTING, states.PREVIEW_STARTING, states.PREVIEW_RUNNING])
    ended = robotctl("preview", "on", "--profile", "high-quality", "--target", target)
    assert ended.returncode == 0, ended.stderr
    assert "RUNNING" in ended.stdout
    assert "srt://" in ended.stdout
    assert double.preview_requests[0].profile == preview_pb2.PREVIEW_PROFILE_HIGH_QUALITY


def test_preview_on_without_a_profile_leaves_it_to_the_robot(target: str, double: GatewayDouble) -> None:
    double.preview_becomes.append(states.PREVIEW_RUNNING)
    assert robotctl("preview", "on", "--target", target).returncode == 0
    assert double.preview_requests[0].profile == preview_pb2.PREVIEW_PROFILE_UNSPECIFIED


@pytest.mark.parametrize("as_json", [False, True])
def test_a_preview_that_is_faulted_ends_1_with_the_robots_reason(
    target: str, double: GatewayDouble, as_json: bool
) -> None:
    double.preview_becomes.append(states.PREVIEW_FAULTED)
    ended = robotctl("preview", "on", "--target", target, *(["--json"] if as_json else []))
    assert ended.returncode == 1
    assert double.fault in only_line(ended.stderr)
    if as_json:
        document = json.loads(ended.stdout)
        assert (document["ok"], document["accepted"]) == (False, True)
        assert document["preview"]["last_error"] == double.fault
        assert json.loads(ended.stderr)["error"]["exit_code"] == 1
    else:
        assert ended.stdout == ""


def test_a_preview_that_takes_too_long_ends_1(target: str, double: GatewayDouble) -> None:
    double.preview_becomes.append(states.PREVIEW_STARTING)
    ended = robotctl("preview", "on", "--wait", "0.3", "--target", target)
    assert ended.returncode == 1
    assert "starting, not running, after 0.3 s" in only_line(ended.stderr)


def test_who_does_not_wait_ends_0_when_the_robot_took_note(target: str, double: GatewayDouble) -> None:
    double.preview_becomes.append(states.PREVIEW_STARTING)
    assert robotctl("preview", "on", "--wait", "0", "--target", target).returncode == 0
    assert double.calls == ["SetPreviewMode"]


def test_preview_off_is_idempotent(target: str) -> None:
    for _ in range(2):
        ended = robotctl("preview", "off", "--target", target)
        assert ended.returncode == 0, ended.stderr
        assert "DISABLED" in ended.stdout


def test_a_robot_that_refuses_ends_1_in_its_own_words(target: str, double: GatewayDouble) -> None:
    double.accept = False
    ended = robotctl("preview", "on", "--target", target)
    assert ended.returncode == 1
    assert "the robot is being serviced" in only_line(ended.stderr)


def test_an_error_of_the_gateway_is_one_line(target: str, double: GatewayDouble) -> None:
    double.failures.append((grpc.StatusCode.INTERNAL, "first line\nsecond line"))
    ended = robotctl("status", "--target", target)
    assert (ended.returncode, ended.stdout) == (1, "")
    assert "first line second line" in only_line(ended.stderr)


@pytest.mark.parametrize(
    ("code", "kind"),
    [
        (grpc.StatusCode.PERMISSION_DENIED, "not_allowed"),
        (grpc.StatusCode.UNIMPLEMENTED, "unsupported"),
        (grpc.StatusCode.RESOURCE_EXHAUSTED, "overloaded"),
    ],
)
def test_what_kind_of_no_it_was_is_for_scripts(
    target: str, double: GatewayDouble, code: grpc.StatusCode, kind: str
) -> None:
    double.failures.append((code, "because"))
    ended = robotctl("status", "--json", "--target", target)
    assert (ended.returncode, ended.stdout) == (1, "")
    error = json.loads(only_line(ended.stderr))["error"]
    assert (error["kind"], error["exit_code"]) == (kind, 1)
    assert error["remedy"]


def test_a_passphrase_is_never_printed(target: str, double: GatewayDouble) -> None:
    robotctl("preview", "on", "--target", target)
    double.status.preview.endpoint.passphrase = "correct horse battery"
    for words in (("status",), ("status", "--json"), ("preview", "on"), ("preview", "on", "--json")):
        ended = robotctl(*words, "--target", target)
        assert ended.returncode == 0
        assert "srt://" in ended.stdout
        assert "correct horse" not in ended.stdout + ended.stderr


def test_an_output_that_takes_nothing_is_one_line(target: str) -> None:
    for words in (("status",), ("status", "--json"), ("watch", "--count", "1")):
        with Path("/dev/full").open("w") as full:
            ended = subprocess.run(
                [ROBOTCTL, *words, "--target", target],
                stdout=full,
                stderr=subprocess.PIPE,
                text=True,
                env=environment(),
                timeout=ENDS_WITHIN_S,
                check=False,
            )
        assert ended.returncode == 1
        assert "the output can't be written: No space left on device" in only_line(ended.stderr)


def unreachable(words: tuple[str, ...]) -> str:
    began_s = time.monotonic()
    ended = robotctl_in_time(*words)
    assert time.monotonic() - began_s < KNOWN_WITHIN_S + START_OF_PYTHON_S
    assert (ended.returncode, ended.stdout) == (3, "")
    return only_line(ended.stderr)


@pytest.mark.parametrize(
    "command", [("status",), ("overlay",), ("watch",), ("preview", "on"), ("preview", "off")]
)
def test_nothing_listens(command: tuple[str, ...]) -> None:
    line = unreachable((*command, "--target", "127.0.0.1:1"))
    assert line.startswith("error: no robot gateway reached at 127.0.0.1:1: nothing listens there. ")


@pytest.mark.parametrize("command", [("status",), ("preview", "on")])
def test_the_address_swallows_everything(command: tuple[str, ...]) -> None:
    with black_hole() as port:
        assert f"127.0.0.1:{port}: no answer" in unreachable((*command, "--target", f"127.0.0.1:{port}"))


def test_the_name_does_not_resolve() -> None:
    line = unreachable(("status", "--target", "no-such-robot.invalid"))
    assert "no-such-robot.invalid:50051: the name does not resolve" in line


def test_a_gateway_that_hangs(target: str, double: GatewayDouble) -> None:
    double.hold.clear()
    assert "did not answer within 2.0 s" in unreachable(("status", "--target", target))


def test_unreachable_as_json() -> None:
    error = json.loads(unreachable(("status", "--json", "--target", "127.0.0.1:1")))["error"]
    assert (error["kind"], error["exit_code"]) == ("unreachable", 3)
    assert error["remedy"]


@pytest.mark.parametrize(
    "words",
    [
        (),
        ("nonsense",),
        ("status", "--nonsense"),
        ("status", "--target", "not an address"),
        ("preview",),
        ("preview", "sideways"),
        ("preview", "on", "--profile", "ultra"),
        ("preview", "on", "--wait", "-1"),
        ("watch", "--interval", "0"),
        ("watch", "--interval", "often"),
        ("watch", "--count", "0"),
    ],
)
def test_a_wrong_command_line_is_one_line_and_ends_2(words: tuple[str, ...]) -> None:
    ended = robotctl(*words)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert only_line(ended.stderr).startswith("error: ")
    error = json.loads(only_line(robotctl(*words, "--json").stderr))["error"]
    assert (error["kind"], error["exit_code"]) == ("usage", 2)


def test_help_and_version_need_no_robot() -> None:
    for words in (("--help",), ("watch", "--help"), ("preview", "on", "--help"), ("--version",)):
        ended = robotctl(*words)
        assert (ended.returncode, ended.stderr) == (0, "")
        assert ended.stdout


def test_a_reader_that_leaves_early_makes_no_noise(target: str) -> None:
    """As in `robotctl watch | head -1`."""
    watching = subprocess.Popen(
        [ROBOTCTL, "watch", "--interval", "0.1", "--target", target],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
    )
    with watching:
        assert watching.stdout
        assert watching.stderr
        assert "health ok" in watching.stdout.readline()
        watching.stdout.close()
        watching.wait(ENDS_WITHIN_S)
        assert watching.stderr.read() == ""


def test_ctrl_c_while_waiting_for_an_answer_shows_no_traceback(target: str, double: GatewayDouble) -> None:
    double.hold.clear()
    asking = subprocess.Popen(
        [ROBOTCTL, "preview", "on", "--target", target],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
    )
    with asking:
        while not double.calls and asking.poll() is None:
            time.sleep(0.01)
        os.kill(asking.pid, signal.SIGINT)
        _, errors = asking.communicate(timeout=ENDS_WITHIN_S)
        assert asking.returncode == 130
        assert "Traceback" not in errors
