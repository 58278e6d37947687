"""A hub of one node loses its disk: what `apply` and `relist` bring back."""

import asyncio
import shutil
from contextlib import aclosing
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner, Result

from bridge.uploads.queue import State
from fleet import names
from fleet.connection import FleetAddress, connect
from fleet.receipt_keys import read_public_keys
from hub.cli import app
from hub.receiver.config import ReceiverSettings
from tests.support.s3_server import S3Server, faulty_store, s3_server
from tests.support.secure_hub import SecureHub, secure_hub
from tests.support.uploading import ROBOT, Robot, receiver_settings, running_receiver, running_uploads

_ANSWERS_WITHIN_S = 30.0


def lose_streams(hub: SecureHub) -> None:
    hub.servers.stop(0)
    shutil.rmtree(hub.servers.directory / "n0" / "jetstream")
    hub.servers.start_all()


def typed(*words: str) -> Result:
    return CliRunner().invoke(app, words, catch_exceptions=False)


def test_robots_get_commands_again_once_it_is_applied(tmp_path: Path) -> None:
    """The defect: none before it was enrolled again."""
    with secure_hub(tmp_path) as hub:
        robot = hub.enroll(ROBOT)
        hub.enroll("gone")
        typed("revoke", "gone", "--dir", str(hub.directory.path))
        lose_streams(hub)
        assert typed("apply", "--dir", str(hub.directory.path)).exit_code == 0
        assert asyncio.run(_consumers(hub)) == {ROBOT}
        asyncio.run(_command(hub.administrator(), robot))


async def _consumers(hub: SecureHub) -> set[str]:
    async with connect(hub.administrator()) as admin:
        await admin.connected(_ANSWERS_WITHIN_S)
        return set((await admin.api(f"CONSUMER.NAMES.{names.COMMANDS}"))["consumers"] or ())


async def _command(administrator: FleetAddress, robot: FleetAddress) -> None:
    """A command is sent, and the robot gets it."""
    subject = names.command_subject(ROBOT, "abc")
    async with connect(administrator) as admin, connect(robot) as its:
        await admin.connected(_ANSWERS_WITHIN_S)
        await its.connected(_ANSWERS_WITHIN_S)
        await admin.publish_once(subject, b"a command")
        async with asyncio.timeout(_ANSWERS_WITHIN_S):
            async with aclosing(its.pull(names.COMMANDS, ROBOT, batch=1)) as deliveries:
                delivery = await anext(deliveries)
        assert (delivery.subject, delivery.payload) == (subject, b"a command")


@pytest.mark.timeout(180)
def test_the_list_of_recordings_comes_back_from_the_store(tmp_path: Path) -> None:
    """The defect: robots do not ask again about what is verified, and nothing else had the list."""
    (tmp_path / "s3").mkdir()
    with s3_server(tmp_path / "s3") as server, secure_hub(tmp_path / "hub") as hub:
        hub.enroll(ROBOT)
        hub.receiver()
        settings = asyncio.run(_upload(server, hub, tmp_path))
        before = asyncio.run(_listed(hub))
        assert set(before) == {f"{ROBOT}.one", f"{ROBOT}.two"}
        client, bucket = server.client, settings.store.bucket
        client.put_object(Bucket=bucket, Key=f"lab/{ROBOT}/forged.recording", Body=b"\x00anything")
        client.delete_object(Bucket=bucket, Key=f"lab/{ROBOT}/two/data.bin")
        lose_streams(hub)
        assert typed("apply", "--dir", str(hub.directory.path)).exit_code == 0
        assert not asyncio.run(_listed(hub))
        config = tmp_path / "receiver.yaml"
        config.write_text(yaml.safe_dump(settings.model_dump(mode="json")), encoding="utf-8")
        for _ in range(2):
            done = typed("relist", "--config", str(config))
            assert done.exit_code == 1
            assert "Listed 1 recordings." in done.output
            assert f"{ROBOT}/forged is not listed" in done.output
            assert f"{ROBOT}/two is not listed" in done.output
            assert asyncio.run(_listed(hub)) == {f"{ROBOT}.one": before[f"{ROBOT}.one"]}


async def _upload(server: S3Server, hub: SecureHub, directory: Path) -> ReceiverSettings:
    robot, files = Robot(), hub.path / ROBOT
    address = hub.address(files / "bridge.creds", names.inbox_prefix(ROBOT))
    async with faulty_store(server) as proxy, connect(address) as its:
        await its.connected(_ANSWERS_WITHIN_S)
        settings = receiver_settings(hub, server.settings(public_endpoint=proxy.url), directory)
        keys = read_public_keys(files / "receipts.pub")
        async with (
            running_receiver(settings),
            running_uploads(robot, its, proxy.host, keys) as running,
        ):
            for name in ("one", "two"):
                robot.add(name, {"data.bin": name.encode()})
                await running.uploads.enqueue(name)
                await running.until(name, lambda upload: upload and upload.state is State.VERIFIED)
    return settings


async def _listed(hub: SecureHub) -> dict[str, bytes]:
    async with connect(hub.administrator()) as admin:
        await admin.connected(_ANSWERS_WITHIN_S)
        return {key: entry.value for key, entry in (await admin.entries(names.RECORDINGS)).items()}
