"""From nothing to an enrolled robot and back, by the commands of the documentation."""

import asyncio
import json
import re
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from common.errors import UserError
from fleet import names
from fleet.connection import Entry, FleetAddress, connect
from fleet.errors import HubError, HubReason, RefusedError
from hub import administration
from hub.cli import app
from hub.directory import HubDirectory
from tests.support.free import free_tcp_port
from tests.support.nats_servers import NatsServers
from tests.support.secure_hub import until_accepted


def _type(*words: str) -> Result:
    return CliRunner().invoke(app, words, catch_exceptions=False)


@pytest.fixture
def hub(tmp_path: Path) -> Iterator[Path]:
    """A hub's directory, and its server, which was started as `init` says."""
    made = tmp_path / "hub"
    result = _type("init", "--out", str(made), "--fleet", "lab", "--host", "127.0.0.1")
    assert f"hub apply --dir {made}" in result.output
    servers = NatsServers(tmp_path, whole=lambda servers, _node: _moved(made, tmp_path, servers))
    # The ports of the documentation may be in use on this machine.
    record = json.loads((made / "hub.json").read_text(encoding="utf-8"))
    record["servers"] = [f"tls://127.0.0.1:{servers.ports[0]}"]
    (made / "hub.json").write_text(json.dumps(record), encoding="utf-8")
    try:
        servers.start_all()
        yield made
    finally:
        servers.close()


def _moved(made: Path, home: Path, servers: NatsServers) -> str:
    text = (made / "nodes" / "n1" / "nats.conf").read_text(encoding="utf-8")
    text = text.replace("/etc/nats", str(made / "nodes" / "n1")).replace("/var/lib/nats", str(home / "data"))
    text = text.replace("0.0.0.0:4222", f"127.0.0.1:{servers.ports[0]}").replace('"n1"', '"n0"')
    return text.replace("127.0.0.1:8222", f"127.0.0.1:{servers.monitors[0]}")


def test_a_robot_comes_and_goes(hub: Path, tmp_path: Path) -> None:
    assert "The hub is ready" in _type("apply", "--dir", str(hub)).output
    assert "The hub is ready" in _type("apply", "--dir", str(hub)).output
    files = tmp_path / "r1"
    _type("enroll", "r1", "--dir", str(hub), "--out", str(files))
    assert {each.name for each in files.iterdir()} == {"bridge.creds", "ca.pem", "receipts.pub", "fleet.yaml"}
    assert all(each.stat().st_mode & 0o077 == 0 for each in files.iterdir())
    fragment = (files / "fleet.yaml").read_text(encoding="utf-8")
    assert "robot: r1\nfleet: lab\n" in fragment
    with pytest.raises(UserError, match="has credentials already"):
        _type("enroll", "r1", "--dir", str(hub), "--out", str(files))
    url = re.search(r"tls://\S+", fragment)
    assert url is not None
    address = FleetAddress((url[0],), files / "bridge.creds", files / "ca.pem", names.inbox_prefix("r1"))
    asyncio.run(_publish(address))
    listed = json.loads(_type("robots", "--json", "--dir", str(hub)).output)
    assert [(each["name"], each["revoked_unix_s"]) for each in listed] == [("r1", None)]
    _type("revoke", "r1", "--dir", str(hub))
    assert json.loads(_type("robots", "--json", "--dir", str(hub)).output)[0]["revoked_unix_s"]
    assert re.search(r"r1 .* UTC", _type("robots", "--dir", str(hub)).output)
    with pytest.raises(RefusedError):
        asyncio.run(_publish(address))


def test_a_configuration_that_can_not_carry_revocations_is_reported(hub: Path, tmp_path: Path) -> None:
    _type("apply", "--dir", str(hub))
    _type("enroll", "r1", "--dir", str(hub), "--out", str(tmp_path / "r1"))
    (hub / "nodes" / "n1" / "nats.conf").write_text("port: 4222\n", encoding="utf-8")
    result = _type("revoke", "r1", "--dir", str(hub))
    assert "n1/nats.conf is not as init makes it" in result.output
    assert f"hub apply --dir {hub}" in result.output
    assert "r1 is revoked." in result.output
    shutil.rmtree(hub / "nodes")
    assert "nats.conf" not in _type("apply", "--dir", str(hub)).output, "the servers alone have theirs"


def test_lower_limits_are_reported_and_not_set(hub: Path) -> None:
    _type("apply", "--dir", str(hub))
    assert _type("apply", "--dir", str(hub), "--events-days", "40").exit_code == 0
    result = _type("apply", "--dir", str(hub), "--events-days", "30")
    assert result.exit_code == 1
    assert "fleet_events: max_age is" in result.output
    assert _type("apply", "--dir", str(hub)).exit_code == 0


def test_a_robot_that_fills_a_stream_for_all_is_found_and_purged(hub: Path, tmp_path: Path) -> None:
    _type("apply", "--dir", str(hub), "--events-mib", "1")
    addresses = {}
    for robot in ("r1", "r2"):
        _type("enroll", robot, "--dir", str(hub), "--out", str(tmp_path / robot))
        url = re.search(r"tls://\S+", (tmp_path / robot / "fleet.yaml").read_text(encoding="utf-8"))
        assert url is not None
        files = tmp_path / robot
        addresses[robot] = FleetAddress(
            (url[0],), files / "bridge.creds", files / "ca.pem", names.inbox_prefix(robot)
        )
    assert asyncio.run(_fill(addresses["r1"], "r1")) > 10
    _type("revoke", "r1", "--dir", str(hub))
    with pytest.raises(HubError) as full:
        asyncio.run(_publish_event(addresses["r2"], "r2"))
    assert full.value.reason is HubReason.FULL, "revoked, and still in the way of all"
    use = _type("usage", "--dir", str(hub)).output
    assert re.search(r"fleet_events +1\.0 +1 +(9\d|100) %", use)
    assert re.search(r"r1 +1\d\d *\n r2 +0", use), "who fills it comes first"
    assert re.search(
        r"fleet_events: deleted 1\d\d messages of r1", _type("purge", "r1", "--dir", str(hub)).output
    )
    asyncio.run(_publish_event(addresses["r2"], "r2"))
    assert "deleted 1 messages of r2" not in _type("purge", "r1", "--recordings", "--dir", str(hub)).output
    assert re.search(r"r2 +1 *\n", _type("usage", "--dir", str(hub)).output), "of r2 all is there"
    with pytest.raises(UserError, match="no robot"):
        _type("purge", "r3", "--dir", str(hub))


async def _publish_event(address: FleetAddress, robot: str) -> None:
    async with connect(address) as hub:
        await hub.connected(5)
        await hub.publish_once(names.event_subject(robot, "run", 1), b"x" * 8192)


async def _fill(address: FleetAddress, robot: str) -> int:
    """Publishes until the stream takes nothing more; returns how many messages it has taken."""
    async with connect(address) as hub:
        await hub.connected(5)
        for number in range(1000):
            try:
                await hub.publish_once(names.event_subject(robot, "run", number), b"x" * 8192)
            except HubError as error:
                if error.reason is not HubReason.FULL:
                    raise
                return number
    raise AssertionError("it takes any number")


def test_logins_of_people_and_receivers(hub: Path, tmp_path: Path) -> None:
    login = _type("operator", "anna", "--dir", str(hub)).output
    assert login.startswith("# Robot Gateway fleet login 1\nfleet: lab\nname: anna\nservers: tls://")
    assert re.search(r"^receivers: [0-9a-f]{64}$", login, re.MULTILINE)
    assert "BEGIN NATS USER JWT" in login
    assert login.rstrip().endswith("-----END CERTIFICATE-----")
    _type("receiver-credentials", "--dir", str(hub), "--out", str(tmp_path / "receiver"))
    assert {each.name for each in (tmp_path / "receiver").iterdir()} == {
        "receiver.creds",
        "ca.pem",
        "receipts.key",
        "receipts.pub",
        "fleet.yaml",
    }
    assert len(json.loads(_type("robots", "--all", "--json", "--dir", str(hub)).output)) == 2
    out = tmp_path / "exporter"
    assert "reads the hub" in _type("operator", "exporter", "--dir", str(hub), "--out", str(out)).output
    assert {each.name for each in out.iterdir()} == {"operator.creds", "ca.pem", "fleet.yaml"}
    assert all(each.stat().st_mode & 0o077 == 0 for each in out.iterdir())
    url = re.search(r"tls://\S+", (out / "fleet.yaml").read_text(encoding="utf-8"))
    assert url is not None
    _type("apply", "--dir", str(hub))
    reader = FleetAddress((url[0],), out / "operator.creds", out / "ca.pem")
    assert asyncio.run(_listed(reader)) == {}
    with pytest.raises(UserError, match="send no commands"):
        _type("operator", "other", "--commands", "--dir", str(hub), "--out", str(tmp_path / "other"))


@pytest.mark.parametrize(
    ("command", "file"),
    [
        (("operator", "exporter", "--out"), "operator.creds"),
        (("receiver-credentials", "--out"), "receiver.creds"),
    ],
)
def test_new_credentials_end_the_old_ones(
    hub: Path, tmp_path: Path, command: tuple[str, ...], file: str
) -> None:
    _type("apply", "--dir", str(hub))
    address = HubDirectory(hub).address("admin")
    for out in ("old", "new"):
        again = ("--again",) if out == "new" else ()
        _type(*command, str(tmp_path / out), "--dir", str(hub), *again)
    asyncio.run(_connected(replace(address, credentials=tmp_path / "new" / file)))
    with pytest.raises(RefusedError):
        asyncio.run(_connected(replace(address, credentials=tmp_path / "old" / file)))


@pytest.mark.parametrize(
    ("words", "error"),
    [
        (("init", "--out", "{}/x", "--nodes", "3", "--host", "a"), "as many times --host"),
        (("init", "--out", "{}/x", "--nodes", "2", "--host", "a", "--host", "b"), "a cluster has three"),
        (("init", "--out", "{}/x", "--fleet", "No Name"), "is no name"),
        (("init", "--out", str(Path(administration.__file__).parent)), "has other files: __init__.py"),
        (("apply", "--dir", "{}/missing"), "no hub's directory"),
        (("robots", "--dir", "{}/missing"), "no hub's directory"),
    ],
)
def test_mistakes_are_explained(tmp_path: Path, words: tuple[str, ...], error: str) -> None:
    with pytest.raises(UserError, match=error) as refused:
        _type(*(word.format(tmp_path) for word in words))
    assert refused.value.remedy


def test_a_hub_that_is_off_is_reported(tmp_path: Path) -> None:
    made = tmp_path / "hub"
    _type("init", "--out", str(made), "--host", "127.0.0.1")
    record = json.loads((made / "hub.json").read_text(encoding="utf-8"))
    record["servers"] = [f"tls://127.0.0.1:{free_tcp_port()}"]
    (made / "hub.json").write_text(json.dumps(record), encoding="utf-8")
    with pytest.raises(UserError, match="can't be reached") as refused:
        _type("enroll", "r1", "--dir", str(made), "--out", str(tmp_path / "r1"))
    assert refused.value.exit_code == 3
    assert not (tmp_path / "r1").exists()


async def _connected(address: FleetAddress) -> None:
    async with connect(address) as hub:
        await until_accepted(hub)


async def _listed(address: FleetAddress) -> dict[str, Entry]:
    async with connect(address) as hub:
        await hub.connected(5)
        return await hub.entries(names.ROBOTS)


async def _publish(address: FleetAddress) -> None:
    async with connect(address) as robot:
        await robot.connected(5)
        await robot.publish_once("fleet.r1.ev.run.1", b"")
