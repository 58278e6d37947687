"""`robot-gateway credentials` and `robotctl login` as people type them, and what must be in no log."""

import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from unittest import mock

import pytest
from typer.testing import CliRunner

from common.errors import UserError
from common.findings import Finding, Verdict
from console.client import Credentials, GatewayClient, NotAllowed
from gateway.access.credential import Validity
from gateway.cli import app
from gateway.doctor.examination import examine
from tests.support.free import free_tcp_port
from tests.support.robotctl import only_line, robotctl
from tests.support.waiting import wait_until

MAIN = "from gateway.cli import main; main()"
SECRET = re.compile(r"rgt-[0-9a-f]{12}\.[A-Za-z0-9_-]{43}|PRIVATE KEY")


@pytest.fixture
def ground(tmp_path: Path) -> Path:
    """A configuration of a gateway with credentials, which do not exist yet."""
    (tmp_path / "gateway.yaml").write_text(
        f"grpc: {{port: {free_tcp_port()}}}\npreview: {{socket: {tmp_path / 'p.sock'}, settle_ms: 0}}\n"
        f"sources: []\nlog_level: debug\nsecurity: {{credentials: {tmp_path / 'credentials'}}}\n"
    )
    return tmp_path


def gateway(ground: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-c", MAIN, *words, "--config", str(ground / "gateway.yaml")],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )


def credentials(ground: Path, *words: str) -> str:
    """What the command prints, in this process, because a program takes its time to start; it must work."""
    done = CliRunner().invoke(app, ["credentials", *words, "--config", str(ground / "gateway.yaml")])
    if done.exception:
        raise done.exception
    return done.stdout


def port_of(ground: Path) -> str:
    found = re.search(r"port: (\d+)", (ground / "gateway.yaml").read_text())
    assert found
    return found[1]


@contextmanager
def running(ground: Path) -> Iterator[Path]:
    """A gateway as a program; its log."""
    log = ground / "log"
    command = [sys.executable, "-c", MAIN, "serve", "--config", str(ground / "gateway.yaml")]
    with log.open("w") as errors, subprocess.Popen(command, stderr=errors) as process:
        try:
            wait_until(lambda: "serving operators" in log.read_text(), "the gateway serves")
            yield log
        finally:
            process.terminate()
            process.wait(10)


def operator(ground: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    return robotctl(*words, XDG_CONFIG_HOME=str(ground / "config"))


@contextmanager
def piped(text: str) -> Iterator[None]:
    """Standard input is a pipe that brings a text."""
    ours, theirs = os.pipe()
    with os.fdopen(theirs, "w", encoding="utf-8") as end:
        end.write(text)
    with os.fdopen(ours, encoding="utf-8") as stdin, mock.patch.object(sys, "stdin", stdin):
        yield


def guess(ground: Path, target: str, login: str) -> None:
    """Shows a token with one slip in it until it is locked: nearly a secret, and in no log either."""
    token = re.search(r"token: (\S+)", login)
    assert token
    slip = token[1][:-2] + ("AA" if token[1][-2] != "A" else "BA")
    shown = Credentials(ca_certificate=(ground / "credentials/ca.pem").read_bytes(), token=slip)
    with GatewayClient(target, credentials=shown) as client:
        for _ in range(7):
            with pytest.raises(NotAllowed):
                client.status()


def follow(advice: str) -> str:
    """Types the command that an output names, as it stands but for what is in capitals; it must work."""
    command = re.search(r"robot-gateway (credentials .+?)(?:;|$)", advice, re.MULTILINE)
    assert command, advice
    words = command[1].replace("NAME", "carl").replace("viewer|operator|admin", "viewer")
    done = CliRunner().invoke(app, shlex.split(words))
    assert not done.exception, f"{words}: {done.exception}"
    return done.output


def access_of(ground: Path) -> Finding:
    """What `robot-gateway doctor` finds of the credentials."""
    return {each.check: each for each in examine(ground / "gateway.yaml")}["access"]


def test_commands_that_are_proposed_work_as_they_stand(ground: Path) -> None:
    """Also where the directory was typed, and has a space in its name."""
    directory = ground / "my credentials"
    for option in (f"--directory={directory}", f"--config={ground / 'gateway.yaml'}"):
        made = CliRunner().invoke(app, ["credentials", "init", option])
        assert "carl, viewer" in follow(made.output)
        unknown = CliRunner().invoke(app, ["credentials", "revoke", "nobody", option]).exception
        assert isinstance(unknown, UserError)
        assert "carl" in follow(unknown.remedy)
        again = CliRunner().invoke(app, ["credentials", "init", option]).exception
        assert isinstance(again, UserError)
        assert "carl" in follow(again.remedy)
    (ground / "credentials/server-key.pem").write_bytes((directory / "server-key.pem").read_bytes())
    follow(access_of(ground).remedy)
    assert access_of(ground).verdict is Verdict.GOOD, "the advice has helped"


def test_from_nothing_to_a_robot_that_is_switched_and_a_credential_that_is_over(ground: Path) -> None:
    without = gateway(ground, "serve")
    assert without.returncode == 2
    assert "robot-gateway credentials init" in only_line(without.stderr)

    credentials(ground, "init", "--host", "lab.local")
    login = ground / "anna.login"
    credentials(ground, "add", "anna", "--role", "operator", "--out", str(login))
    printed = credentials(ground, "add", "ben", "--role", "viewer")
    target = f"127.0.0.1:{port_of(ground)}"
    with running(ground) as log:
        assert operator(ground, "login", "lab", target, str(login)).returncode == 0
        assert operator(ground, "status", "--json").returncode == 0
        # The request is accepted, although there is no preview service.
        assert "preview" in operator(ground, "preview", "on").stderr

        (ground / "ben.login").write_text(printed)
        assert operator(ground, "login", "lab-ben", target, str(ground / "ben.login")).returncode == 0
        refused = operator(ground, "--robot", "lab-ben", "preview", "on")
        assert refused.returncode == 1
        assert "ben is viewer, and SetPreviewMode needs operator" in only_line(refused.stderr)

        credentials(ground, "revoke", "anna")
        wait_until(lambda: operator(ground, "status").returncode == 1, "anna is refused")
        over = only_line(operator(ground, "status").stderr)
        assert "was revoked" in over
        assert "robotctl login" in over

        stranger = robotctl("--target", target, "status")
        assert stranger.returncode == 3
        assert "robotctl login" in only_line(stranger.stderr)

        guess(ground, target, login.read_text())
        wait_until(lambda: "is locked out" in log.read_text(), "who guesses is locked out")

    # What everything that has run has written, but for files that are meant to hold a secret.
    kept = {login, ground / "ben.login", *(ground / "config").rglob("token-*"), *ground.rglob("*-key.pem")}
    written = [path for path in ground.rglob("*") if path.is_file() and path not in kept]
    credentials_files = ("audit.jsonl", "audit-refused.jsonl", "credentials.json")
    assert {log, *(ground / "credentials" / name for name in credentials_files)} <= set(written)
    assert [path for path in written if SECRET.search(path.read_text())] == []
    assert SECRET.search(login.read_text())


def test_a_login_from_a_pipe_is_accepted_every_time(ground: Path) -> None:
    """The gateway's own look at the list comes every half a second; the pipe is faster."""
    credentials(ground, "init", "--host", "lab.local")
    with running(ground):
        for number in range(9):
            login = credentials(ground, "add", f"person-{number}", "--role", "viewer")
            with piped(login):
                done = operator(ground, "login", f"lab{number}", f"127.0.0.1:{port_of(ground)}")
            assert done.returncode == 0, done.stderr
        for number in (0, 8):
            credentials(ground, "revoke", f"person-{number}")
        audit = ground / "credentials/audit.jsonl"
        wait_until(
            lambda: "revoked person-8 (viewer, " in audit.read_text(), "the audit log names whose it was"
        )


def test_a_login_is_stored_over_another_only_on_request(ground: Path) -> None:
    credentials(ground, "init")
    login = ground / "anna.login"
    credentials(ground, "add", "anna", "--role", "viewer", "--out", str(login))
    words = ("login", "lab", "lab.local:1", str(login), "--offline")
    assert operator(ground, *words).returncode == 0
    again = operator(ground, *words)
    assert again.returncode == 2
    assert f"robotctl login lab lab.local:1 {login} --offline --replace" in only_line(again.stderr)
    assert operator(ground, *words, "--replace").returncode == 0


def test_a_login_in_a_pipe_over_another_one_is_not_lost_unnoticed(ground: Path) -> None:
    credentials(ground, "init", "--host", "lab.local")
    words = ("login", "lab", f"127.0.0.1:{port_of(ground)}")
    with running(ground):
        for number in (1, 2):
            issued = credentials(ground, "add", "anna", "--role", "viewer")
            with piped(issued):
                done = operator(ground, *words)
            assert done.returncode == (0 if number == 1 else 2)
        said = only_line(done.stderr)
        assert "not stored, but stays valid" in said
        assert "repeat the whole pipe, with --replace" in said
        revoke = re.search(r"robot-gateway credentials (revoke [0-9a-f]{12});", said)
        assert revoke, said
        credentials(ground, *revoke[1].split())
        states = {each["id"]: each["state"] for each in json.loads(credentials(ground, "list", "--json"))}
        assert sorted(states.values()) == ["revoked", "valid"], "of the same name, the one in the pipe alone"
        assert operator(ground, "status").returncode == 0


def assert_the_piped_login_can_be_revoked(ground: Path, robot: str, host: str, says: str) -> None:
    issued = credentials(ground, "add", "anna", "--role", "viewer")
    with piped(issued):
        done = operator(ground, "login", robot, f"{host}:{port_of(ground)}")
    assert done.returncode != 0
    said = only_line(done.stderr)
    assert says in said
    assert "not stored, but stays valid" in said
    assert said.endswith("then repeat the whole pipe")
    revoke = re.search(r"robot-gateway credentials (revoke [0-9a-f]{12});", said)
    assert revoke, said
    credentials(ground, *revoke[1].split())
    states = [each["state"] for each in json.loads(credentials(ground, "list", "--json"))]
    assert states == ["revoked"]
    assert not (ground / "config/robotctl").exists()


@pytest.mark.parametrize(
    ("robot", "says"), [("lab", "nothing listens there"), ("lab 2", "lab 2")], ids=["unreachable", "misnamed"]
)
def test_a_login_in_a_pipe_that_reaches_no_robot_can_be_revoked(ground: Path, robot: str, says: str) -> None:
    """The robot has issued it, whatever becomes of it at the other end of the pipe."""
    credentials(ground, "init")
    assert_the_piped_login_can_be_revoked(ground, robot, "127.0.0.1", says)


def test_a_login_in_a_pipe_to_an_address_that_the_certificate_lacks_can_be_revoked(ground: Path) -> None:
    file = ground / "gateway.yaml"
    file.write_text(file.read_text().replace("grpc: {", "grpc: {host: 127.0.0.2, "))
    credentials(ground, "init")
    with running(ground):
        assert_the_piped_login_can_be_revoked(ground, "lab", "127.0.0.2", "is not trusted")


def test_the_command_after_a_new_ca_is_complete(ground: Path) -> None:
    credentials(ground, "init")
    done = gateway(ground, "credentials", "rotate", "ca")
    assert f"robotctl login ROBOT HOST:{port_of(ground)} --ca FILE" in done.stderr


def test_the_list_for_programs_has_the_keys_and_states_of_the_page(ground: Path) -> None:
    credentials(ground, "init")
    for name in ("anna", "ben"):
        credentials(ground, "add", name, "--role", "viewer")
    credentials(ground, "revoke", "anna")
    listed = json.loads(credentials(ground, "list", "--json"))
    assert {each["name"]: each["state"] for each in listed} == {"anna": "revoked", "ben": "valid"}
    assert [each["name"] for each in listed if each["revoked_unix_ms"]] == ["anna"]
    page = (Path(__file__).parents[4] / "docs/security.md").read_text(encoding="utf-8")
    keys = page.partition("`list --json` prints for each: ")[2].partition("(null")[0]
    for each in listed:
        assert list(each) == re.findall(r"`(\w+)`", keys)
    assert re.findall(r'"([^"]+)"', keys) == [validity.value for validity in Validity]


def test_rights_are_tight_whatever_the_umask_says(ground: Path) -> None:
    credentials(ground, "init")
    credentials(ground, "add", "anna", "--role", "admin", "--certificate", "--out", str(ground / "x/a.login"))
    with running(ground):
        login = operator(
            ground, "login", "lab", f"127.0.0.1:{port_of(ground)}", str(ground / "x/a.login"), "--offline"
        )
        assert login.returncode == 0, login.stderr
    for top in (ground / "credentials", ground / "config/robotctl", ground / "x"):
        for path in (top, *top.rglob("*")):
            assert path.stat().st_mode & 0o777 == (0o700 if path.is_dir() else 0o600), path


@pytest.mark.parametrize("file", ["credentials.json", "server-key.pem"])
def test_a_gateway_does_not_start_with_secrets_that_others_may_read(ground: Path, file: str) -> None:
    credentials(ground, "init")
    (ground / "credentials" / file).chmod(0o640)
    done = gateway(ground, "serve")
    assert done.returncode == 2
    assert f"chmod 600 {ground / 'credentials' / file}" in only_line(done.stderr)


def test_calls_at_once_lose_nothing(ground: Path) -> None:
    credentials(ground, "init")
    names = [f"person-{number}" for number in range(4)]
    with ThreadPoolExecutor(3) as pool:
        done = pool.map(lambda name: gateway(ground, "credentials", "add", name, "--role", "viewer"), names)
        assert [each.returncode for each in done] == [0] * len(names)
    listed = json.loads(credentials(ground, "list", "--json"))
    assert sorted(each["name"] for each in listed) == names
    assert len({each["id"] for each in listed}) == len(names)


def test_what_is_there_is_not_thrown_away_by_mistake(ground: Path) -> None:
    credentials(ground, "init")
    credentials(ground, "add", "anna", "--role", "admin")
    with pytest.raises(UserError, match="--again"):
        credentials(ground, "init")
    assert len(json.loads(credentials(ground, "list", "--json"))) == 1
    credentials(ground, "init", "--again")
    assert json.loads(credentials(ground, "list", "--json")) == []


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("revoke", "nobody"), "no valid credential"),
        (("rotate", "nobody"), "no valid credential"),
        (("add", "../x", "--role", "viewer"), "can't be the name"),
    ],
)
def test_what_can_not_be_is_one_line(ground: Path, words: tuple[str, ...], complaint: str) -> None:
    credentials(ground, "init")
    with pytest.raises(UserError, match=complaint):
        credentials(ground, *words)


def test_a_login_for_another_robot_is_refused_before_anything_is_sent(ground: Path, tmp_path: Path) -> None:
    """Two robots have two authorities."""
    credentials(ground, "init", "--host", "lab.local")
    other = str(tmp_path / "other")
    credentials(ground, "init", "--directory", other)
    login = ground / "other.login"
    credentials(ground, "add", "anna", "--role", "admin", "--directory", other, "--out", str(login))
    with running(ground) as log:
        done = operator(ground, "login", "lab", f"127.0.0.1:{port_of(ground)}", str(login))
        assert done.returncode == 1
        assert "not trusted" in only_line(done.stderr)
        assert not (ground / "config").exists()
    assert "wrong tokens" not in log.read_text()
