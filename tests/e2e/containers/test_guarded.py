"""A gateway that asks who calls, in containers: from a start without credentials to one that has ended."""

import json
import re
import socket
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest

from common.ca import new_ca
from console.client.blocking import GatewayClient
from console.client.errors import GatewayError, NotAllowed, NotTrusted, Unreachable
from console.client.results import PreviewState
from console.credentials import Credentials
from console.receiver.address import StreamAddress
from console.receiver.errors import StreamRefusedError
from console.robots.login import parse_login
from gateway.rpc.connections.admission import MAX_PENDING
from tests.e2e.containers.credentials import ADD, added, knows, typed
from tests.e2e.containers.deployment import (
    Deployment,
    demo_overlay,
    deployed,
    docker,
    is_healthy,
    mounts,
    status_with,
    writable,
)
from tests.support.engine import ROOT, TAG
from tests.support.receiver import Receiver
from tests.support.robotctl import robotctl
from tests.support.waiting import wait_until
from tests.support.watcher import Watcher

pytestmark = [pytest.mark.docker, pytest.mark.gst, pytest.mark.timeout(900)]

CREDENTIALS = Path("/var/lib/robot-gateway/credentials")
AUDIT = Path("/var/lib/robot-gateway/audit")
OWNER = (10001, 10000)
SECRET = re.compile(r"rgt-[0-9a-f]{12}\.[A-Za-z0-9_-]{43}|PRIVATE KEY")

UP = "docker compose up -d"
INIT = "docker compose run --rm -T credentials init"
REVOKE = "docker compose run --rm -T credentials revoke anna"
LIST = "docker compose run --rm -T credentials list"
READ_AUDIT = f"docker compose exec gateway cat {AUDIT}/audit.jsonl"
READ_REFUSED = f"docker compose exec gateway cat {AUDIT}/audit-refused.jsonl"
UP_WITHIN_S = 60.0
KEPT_AWAY = 6
"""Attempts of half a second: longer than the first block of an address lasts, shorter than the second."""
HEALTH = "docker compose exec gateway python -m common.healthcheck unix:/tmp/health.sock preview"


@dataclass(frozen=True)
class Guarded:
    """A deployment with credentials, and what was said on the way there.

    Attributes:
        refused: how the start ended before there were credentials.
        said: what the log said then, line by line.
        gateways_then: the state of the gateway's container then.
        begun: what the command printed that the line had named.
        anna: an operator's credentials.
        ben: a viewer's.
    """

    deployment: Deployment
    refused: Any
    said: tuple[str, ...]
    gateways_then: str
    begun: Any
    anna: Credentials
    ben: Credentials

    def audit(self, who: str) -> list[dict[str, str]]:
        """One caller's records, done before refused, oldest first, read as the page says."""
        files = [typed(self.deployment, command).stdout for command in (READ_AUDIT, READ_REFUSED)]
        lines = [line for file in files for line in file.splitlines()]
        return [record for record in map(json.loads, lines) if record["who"] == who]


@pytest.fixture(scope="module")
def guarded(
    tmp_path_factory: pytest.TempPathFactory,
    images: str,  # noqa: ARG001  # for its effect
) -> Iterator[Guarded]:
    overlays = (demo_overlay(), str(ROOT / "compose.guarded.yaml"))
    with deployed(tmp_path_factory.mktemp("guarded"), *overlays, up=False) as deployment:
        refused = typed(deployment, UP)
        said = tuple(deployment.logs("gateway-config").splitlines())
        gateways_then = deployment.inspect("gateway")["State"]["Status"]
        # Whatever the line says is what is typed.
        says = re.search(r"Type: (docker compose .+)$", said[-1])
        assert says, said
        begun = typed(deployment, says[1])
        up = typed(deployment, UP)
        assert up.returncode == 0, up.stderr + deployment.logs("gateway-config")
        anna, ben = added(deployment, "anna", "operator"), added(deployment, "ben", "viewer")
        with deployment.client(ben) as robot:
            wait_until(lambda: knows(robot), "the gateway knows its new credentials", UP_WITHIN_S)
            deployment.wait_for_status(robot)
        yield Guarded(deployment, refused, said, gateways_then, begun, anna, ben)


STRANGER = f"""
import socket, time
held, in_a_row, until_s = [], 0, time.monotonic() + 15
while in_a_row < {KEPT_AWAY} and time.monotonic() < until_s:
    try:
        held.append(socket.create_connection(("gateway", 50051), timeout=0.5))
        in_a_row = 0
        time.sleep(0.02)
    except TimeoutError:
        in_a_row += 1

def is_open(connection):
    connection.setblocking(False)
    try:
        return bool(connection.recv(1024))
    except BlockingIOError:
        return True
    except ConnectionError:
        return False

print(in_a_row, len(held), sum(is_open(each) for each in held))
"""
"""Connects and says nothing, until attempts in a row come to nothing; 50 times a second else."""
FILTERS = "from gateway.rpc.connections import packet_filter; import socket; "
FILTERS += "packet_filter.attach(socket.create_server(('127.0.0.1', 0)), packet_filter.DROP_ALL)"


def reason(deployment: Deployment, shown: Credentials | None) -> str:
    """Why the status is refused."""
    with deployment.client(shown) as robot:
        return refusal(robot)


def refusal(robot: GatewayClient) -> str:
    """The same of a client's next call; empty where it is not refused."""
    try:
        robot.status()
    except GatewayError as error:
        return error.reason or type(error).__name__
    return ""


@pytest.mark.parametrize("command", [UP, INIT, ADD, REVOKE, LIST, READ_AUDIT, READ_REFUSED, HEALTH])
def test_the_pages_say_what_is_typed_here(command: str) -> None:
    pages = "".join(
        (ROOT / "docs" / page).read_text(encoding="utf-8") for page in ("deploy.md", "security.md")
    )
    assert command in pages


def test_without_credentials_the_start_ends_with_one_line_that_says_what_to_type(guarded: Guarded) -> None:
    assert guarded.refused.returncode != 0
    assert "gateway-config" in guarded.refused.stderr
    assert len(guarded.said) == 1, guarded.said
    assert guarded.said[0].endswith(f"Type: {INIT}")
    assert guarded.gateways_then == "created", "the gateway itself was never started, so nothing loops"


def test_init_says_by_which_names_to_call_and_what_to_type_next(guarded: Guarded) -> None:
    assert guarded.begun.returncode == 0, guarded.begun.stderr
    assert guarded.begun.stdout == ""
    said = guarded.begun.stderr
    valid_for = re.search(r"The certificate is valid for (.+)\.$", said, re.MULTILINE)
    assert valid_for, said
    # The robot's own name, not the container's.
    assert {"127.0.0.1", "localhost", socket.gethostname().partition(".")[0]} <= set(valid_for[1].split(", "))
    assert f"{ADD.partition('anna')[0]}NAME" in said
    assert "In the gateway's configuration" not in said, "compose has said it already"

    again = typed(guarded.deployment, INIT)
    assert again.returncode == 1
    assert again.stderr.splitlines()[-1].endswith("with --again all of them are discarded")


def test_a_login_is_all_that_goes_to_standard_output_and_works_on_a_laptop(
    guarded: Guarded, tmp_path: Path
) -> None:
    done = typed(guarded.deployment, ADD.replace("anna", "dora"))
    login = parse_login(done.stdout)
    assert (login.name, login.role) == ("dora", "operator")
    assert "On the laptop:  robotctl login ROBOT HOST:50051 FILE" in done.stderr
    assert not SECRET.search(done.stderr)

    (tmp_path / "dora.login").write_text(done.stdout, encoding="utf-8")
    here, target = {"XDG_CONFIG_HOME": str(tmp_path)}, guarded.deployment.target
    with guarded.deployment.client(login.credentials) as robot:
        wait_until(lambda: knows(robot), "the gateway knows its new credential", UP_WITHIN_S)
    kept = robotctl("login", "lab2", target, str(tmp_path / "dora.login"), **here)
    assert kept.returncode == 0, kept.stderr
    status = robotctl("status", "--json", **here)
    assert status.returncode == 0, status.stderr
    assert "dora" in typed(guarded.deployment, LIST).stdout


def test_it_is_healthy_by_a_socket_that_no_one_else_can_enter(guarded: Guarded) -> None:
    guarded.deployment.wait_healthy("gateway", "preview")
    last = guarded.deployment.inspect("gateway")["State"]["Health"]["Log"][-1]
    assert last["Output"].strip() == "unix:/tmp/health.sock: SERVING"
    assert typed(guarded.deployment, HEALTH).stdout.strip() == "unix:/tmp/health.sock: SERVING"
    directory = Path(f"/proc/{guarded.deployment.program_pid('gateway')}/root/tmp").stat()
    assert (directory.st_mode & 0o7777, directory.st_uid) == (0o700, OWNER[0])


def test_no_unknown_caller_is_admitted(guarded: Guarded) -> None:
    robot, anna = guarded.deployment, guarded.anna
    foreign = new_ca("another robot", 1).certificate
    assert anna.token
    slip = anna.token[:-2] + ("AA" if anna.token[-2] != "A" else "BA")
    assert reason(robot, Credentials(ca_certificate=anna.ca_certificate)) == "CREDENTIAL_MISSING"
    assert reason(robot, replace(anna, token=slip)) == "CREDENTIAL_UNKNOWN"
    assert reason(robot, None) == Unreachable.__name__
    assert reason(robot, Credentials(token=anna.token)) == Unreachable.__name__
    assert reason(robot, replace(anna, ca_certificate=foreign)) == NotTrusted.__name__
    with robot.client(anna) as known:
        status_with(known, is_healthy, "all is well with the robot")


def test_a_viewer_looks_on_an_operator_switches_and_both_are_in_the_audit_log(guarded: Guarded) -> None:
    robot = guarded.deployment
    with robot.client(guarded.ben) as viewer, robot.client(guarded.anna) as operator:
        operator.disable_preview()
        with pytest.raises(NotAllowed) as caught:
            viewer.enable_preview()
        assert caught.value.reason == "ROLE_TOO_LOW"
        assert viewer.status().preview.state is PreviewState.DISABLED

        change = operator.enable_preview()
        assert change.preview.state is PreviewState.RUNNING
        stream = change.preview.endpoint
        assert stream
        assert stream.encrypted
        with Watcher(robot.preview_port, stream.passphrase) as looking_on:
            looking_on.wait_for_frames(30)
        # The door is guarded, and so is the window.
        for passphrase in ("", "x" * len(stream.passphrase)):
            address = StreamAddress("127.0.0.1", robot.preview_port, passphrase=passphrase)
            with Receiver(address) as receiver, pytest.raises(StreamRefusedError, match="passphrase"):
                receiver.next_frame(timeout_s=20)
        operator.disable_preview()
    on, _ = wait_until(lambda: switched_on_and_off(guarded.audit("anna")), "the records are written")
    assert (on["action"], on["role"], on["result"]) == ("SetPreviewMode", "operator", "accepted")
    assert guarded.anna.token
    assert on["credential"] in guarded.anna.token
    # As the gateway sees who calls a port that Docker publishes on loopback: from its network's own gateway.
    network = json.loads(docker("network", "inspect", f"{robot.project}_graph"))[0]
    assert on["address"].rpartition(":")[0] == network["IPAM"]["Config"][0]["Gateway"]
    tried = guarded.audit("ben")[-1]
    assert (tried["action"], tried["role"], tried["result"]) == ("SetPreviewMode", "viewer", "refused")


def switched_on_and_off(records: list[dict[str, str]]) -> list[dict[str, str]]:
    """The newest two, if they are that."""
    newest = records[-2:]
    return newest if [each["request"] for each in newest] == ["enabled: true", "enabled: false"] else []


def test_revoking_takes_effect_in_a_gateway_that_goes_on(guarded: Guarded) -> None:
    robot = guarded.deployment
    before = robot.inspect("gateway")["State"]["StartedAt"]
    cora = added(robot, "cora", "operator")
    with robot.client(cora) as over, robot.client(guarded.ben) as other:
        wait_until(lambda: knows(over), "the gateway knows its new credential", UP_WITHIN_S)
        done = typed(robot, REVOKE.replace("anna", "cora"))
        assert re.fullmatch(r"revoked: [0-9a-f]{12}, operator cora", done.stdout.strip()), done.stderr
        # No answer in time is no refusal.
        wait_until(lambda: refusal(over) == "CREDENTIAL_REVOKED", "cora is refused")
        other.status()
    assert robot.inspect("gateway")["State"]["StartedAt"] == before
    assert robot.restarts("gateway") == 0


def test_the_volumes_are_the_gateways_users_alone(guarded: Guarded) -> None:
    root = Path(f"/proc/{guarded.deployment.program_pid('gateway')}/root")
    with guarded.deployment.client(guarded.ben) as viewer, pytest.raises(NotAllowed):
        viewer.disable_preview()
    wait_until(lambda: guarded.audit("ben"), "there is an audit log")
    for top in (CREDENTIALS, AUDIT):
        inside = root / top.relative_to("/")
        files = list(inside.iterdir())
        assert files, top
        for path in (inside, *files):
            found = path.stat()
            rights = (found.st_mode & 0o777, found.st_uid, found.st_gid)
            assert rights == (0o700 if path == inside else 0o600, *OWNER), path


def test_a_gateway_that_was_broken_into_can_add_no_credential(guarded: Guarded) -> None:
    robot = guarded.deployment
    touched = robot.run("exec", "gateway", "touch", str(CREDENTIALS / "credentials.json"), check=False)
    assert "Read-only file system" in touched.stderr
    eve = robot.run(
        "exec", "gateway", "robot-gateway", "credentials", "add", "eve", "--role", "admin", check=False
    )
    assert eve.returncode == 1
    assert not eve.stdout
    assert "Read-only file system" in eve.stderr
    assert "Traceback" not in eve.stderr


def test_an_address_that_connects_again_and_again_costs_others_nothing(guarded: Guarded) -> None:
    """Kept away by the kernel, or, where that permits filters to root alone, closed as it comes."""
    robot = guarded.deployment
    permitted = robot.run("exec", "gateway", "python", "-c", FILTERS, check=False).returncode == 0
    stranger = (
        "--network",
        f"{robot.project}_graph",
        "--rm",
        "--entrypoint",
        "python",
        f"robot-gateway:{TAG}",
    )
    with robot.client(guarded.anna) as operator:
        said = docker("run", *stranger, "-c", STRANGER)
        status_with(operator, is_healthy, "all is well with the robot")
    in_a_row, held, still_open = map(int, said.split())
    assert still_open <= MAX_PENDING // 2
    assert (in_a_row == KEPT_AWAY) is permitted
    assert permitted or held > MAX_PENDING
    with robot.client(guarded.ben) as new:
        new.status()


def test_nothing_can_be_written_beyond_what_is_declared(guarded: Guarded) -> None:
    pid = guarded.deployment.program_pid("gateway")
    assert writable(pid) == {"/tmp", "/dev/shm", str(AUDIT)}
    assert "ro" in mounts(pid)["/"]
    assert "ro" in mounts(pid)[str(CREDENTIALS)]


def test_no_secret_is_in_any_log(guarded: Guarded) -> None:
    robot, shown = guarded.deployment, guarded.anna
    assert shown.token
    for wrong in (shown.token[:-3] + "AAA", shown.token + "x", "x" + shown.token):
        # What names no credential may be locked out: clients of these tests ask before theirs is known.
        assert reason(robot, replace(shown, token=wrong)) in {"CREDENTIAL_UNKNOWN", "LOCKED_OUT"}
    with robot.client(shown) as operator:
        stream = operator.enable_preview().preview.endpoint
        assert stream
        assert stream.passphrase
        operator.disable_preview()
    written = "".join(
        [robot.run("logs").stdout, *(typed(robot, each).stdout for each in (READ_AUDIT, READ_REFUSED))]
    )
    assert "SetPreviewMode" in written
    assert not SECRET.search(written)
    for secret in (shown.token, guarded.ben.token or "", stream.passphrase):
        assert secret.rpartition(".")[2][:-3] not in written


@pytest.mark.parametrize("words", [("restart", "gateway"), ("up", "-d", "--force-recreate", "gateway")])
def test_credentials_and_audit_log_outlast_the_container(guarded: Guarded, words: tuple[str, ...]) -> None:
    robot = guarded.deployment
    with robot.client(guarded.anna) as operator:
        operator.disable_preview()
        before = wait_until(lambda: guarded.audit("anna"), "the record is written")
        robot.run(*words)
        wait_until(lambda: knows(operator), "the gateway is back and knows its credentials", UP_WITHIN_S)
        operator.disable_preview()
        wait_until(lambda: len(guarded.audit("anna")) > len(before), "one record more")
        assert guarded.audit("anna")[: len(before)] == before
    wait_until(lambda: typed(robot, HEALTH).returncode == 0, "both serve", UP_WITHIN_S)
