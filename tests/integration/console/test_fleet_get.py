"""`robotctl fleet get` by the installed program: a real hub, receiver and store; the robot is not there."""

import asyncio
import json
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from bridge.uploads.queue import State
from fleet import names
from fleet.connection import Hub, connect
from fleet.receipt_keys import ReceiptSigner, new_seed
from hub import administration
from hub.receiver import verified
from omniseer.fleet.v1 import upload_pb2 as pb
from tests.support.eventually import eventually
from tests.support.robotctl import ROBOTCTL, environment, robotctl_process
from tests.support.secure_hub import SecureHub
from tests.support.upload_ground import Ground, ground, secure, store_server  # noqa: F401  # pytest finds them
from tests.support.uploading import FLEET, MIB, ROBOT, Robot, content, running_receiver, running_uploads

if TYPE_CHECKING:
    import subprocess

FILES = {"data/000000.mcap": content(9 * MIB + 5), "data/metadata.yaml": b"version: 9\n", "empty": b""}
SIZE = sum(map(len, FILES.values()))
_logins = iter(range(1_000_000))


class Laptop:
    """An operator's computer.

    Args:
        hub: Whose login it has.
        home: Its folder.
    """

    def __init__(self, hub: SecureHub, home: Path) -> None:
        self.home = home
        self.environment = {"XDG_CONFIG_HOME": str(home / "config")}
        login = administration.operator_login(
            hub.directory, f"anna{next(_logins)}", commands=False, days=None, again=False
        )
        # The servers of the directory are those of its plan.
        file = home / "anna.login"
        file.write_text(login, encoding="utf-8")
        kept = robotctl_process("fleet", "login", str(file), **self.environment)
        assert kept.returncode == 0, kept.stderr

    async def get(self, *words: str, recording: str = "one") -> "subprocess.CompletedProcess[str]":
        """What `fleet get` does and prints."""
        return await asyncio.to_thread(
            robotctl_process,
            *("fleet", "get", ROBOT, recording, "--to", str(self.home / "to"), *words),
            **self.environment,
        )

    async def got(self, *words: str) -> Any:
        """What it prints with --json when it succeeds."""
        done = await self.get(*words, "--json")
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    @property
    def folder(self) -> Path:
        return self.home / "to" / ROBOT / "one"

    def files(self) -> dict[str, bytes]:
        return {
            str(path.relative_to(self.folder)): path.read_bytes()
            for path in self.folder.rglob("*")
            if path.is_file()
        }


@pytest.fixture
def laptop(secure: SecureHub, tmp_path: Path) -> Laptop:  # noqa: F811  # a fixture
    return Laptop(secure, tmp_path)


@asynccontextmanager
async def stored(ground: Ground, files: dict[str, bytes] = FILES) -> AsyncIterator[None]:  # noqa: F811
    """A recording is in the store, verified, and a receiver runs."""
    robot = Robot()
    robot.add("one", files)
    async with running_receiver(ground.receivers[0]):
        async with running_uploads(robot, ground.hub, ground.proxy.host, ground.keys) as running:
            await running.uploads.enqueue("one")
            await running.until("one", lambda each: each is not None and each.state is State.VERIFIED)
        ground.proxy.ranges.clear()
        yield


def key_of(name: str) -> str:
    return f"{FLEET}/{ROBOT}/one/{name}"


@asynccontextmanager
async def administering(hub: SecureHub) -> AsyncIterator[Hub]:
    async with connect(hub.administrator()) as connection:
        await connection.connected(20)
        yield connection


async def entry(hub: Hub) -> pb.StoredRecording:
    return pb.StoredRecording.FromString((await hub.entries(names.RECORDINGS))[f"{ROBOT}.one"].value)


async def test_what_the_robot_recorded_is_on_this_computer(ground: Ground, laptop: Laptop) -> None:  # noqa: F811
    async with stored(ground):
        done = await laptop.got()
        assert done == {
            "ok": True,
            "folder": str(laptop.folder),
            "files": 3,
            "size": SIZE,
            "received": SIZE,
            "cuts": 0,
            "not_final": [],
        }
        assert laptop.files() == FILES
        refused = await laptop.get()
        assert refused.returncode == 1
        assert "is there already" in refused.stderr
        assert "(--resume)" in refused.stderr
        again = await laptop.got("--resume")
        assert again["received"] == 0
        # What was changed here is kept.
        (laptop.folder / "empty").write_bytes(b"notes")
        changed = await laptop.get("--resume")
        assert changed.returncode == 1
        assert "with other content" in changed.stderr
        assert (laptop.folder / "empty").read_bytes() == b"notes"


async def test_a_cut_costs_no_byte_twice(ground: Ground, laptop: Laptop) -> None:  # noqa: F811
    async with stored(ground):
        ground.proxy.cut_reading_at = 3 * MIB + 17
        done = await laptop.got()
        assert laptop.files() == FILES
        assert done["cuts"] == 1
        assert done["received"] == SIZE
        (resumed,) = filter(None, ground.proxy.ranges)
        assert int(resumed.removeprefix("bytes=").removesuffix("-")) == 3 * MIB + 17


async def test_an_expired_url_is_renewed(ground: Ground, laptop: Laptop) -> None:  # noqa: F811
    async with stored(ground):
        ground.proxy.answers.extend([(403, "AccessDenied"), (503, "SlowDown"), (500, "InternalError")])
        done = await laptop.got()
        assert (done["cuts"], laptop.files()) == (3, FILES)


async def test_an_interrupted_copy_goes_on_where_it_was(ground: Ground, laptop: Laptop) -> None:  # noqa: F811
    async with stored(ground):
        part = laptop.folder / "data" / "000000.mcap.part"
        part.parent.mkdir(parents=True)
        part.write_bytes(FILES["data/000000.mcap"][: 5 * MIB])
        done = await laptop.got("--resume")
        assert laptop.files() == FILES
        assert done["received"] == SIZE - 5 * MIB


async def test_ctrl_c_says_how_to_go_on(ground: Ground, laptop: Laptop) -> None:  # noqa: F811
    async with stored(ground):
        # The store refuses for ever: the copy waits.
        ground.proxy.answers.extend([(503, "SlowDown")] * 100)
        process = await asyncio.create_subprocess_exec(
            ROBOTCTL, "fleet", "get", ROBOT, "one", "--to", str(laptop.home / "to"),
            env=environment(**laptop.environment),
            stderr=asyncio.subprocess.PIPE,
        )  # fmt: skip

        async def begun() -> bool:
            return any(laptop.home.rglob("*.part"))

        await eventually(begun, bool, "it has begun")
        process.send_signal(signal.SIGINT)
        async with asyncio.timeout(30):
            _, said = await process.communicate()
        assert process.returncode == 130
        assert f"robotctl fleet get {ROBOT} one --to {laptop.home / 'to'} --resume" in said.decode()
        assert "Traceback" not in said.decode()


async def test_other_bytes_in_the_store_are_never_kept(ground: Ground, laptop: Laptop) -> None:  # noqa: F811
    async with stored(ground):
        name = "data/000000.mcap"
        changed = bytes([FILES[name][0] ^ 1]) + FILES[name][1:]
        put = {"Bucket": ground.store.bucket, "Key": key_of(name)}
        ground.server.client.put_object(**put, Body=changed)
        refused = await laptop.get()
        assert refused.returncode == 1
        assert "another SHA-256" in refused.stderr
        assert name not in laptop.files()
        ground.server.client.put_object(**put, Body=changed[:-1])
        shorter = await laptop.get("--resume")
        assert (shorter.returncode, "another size" in shorter.stderr) == (1, True)
        ground.server.client.delete_object(**put)
        gone = await laptop.get("--resume")
        assert (gone.returncode, "does not have" in gone.stderr) == (1, True)
        assert name not in laptop.files()


async def test_what_no_receiver_has_signed_is_not_copied(
    ground: Ground,  # noqa: F811
    laptop: Laptop,
    secure: SecureHub,  # noqa: F811
) -> None:
    async with stored(ground), administering(secure) as hub:
        made = await entry(hub)
        forged = pb.StoredRecording.FromString(made.SerializeToString())
        forged.receipt.CopyFrom(ReceiptSigner(new_seed()).sign(pb.Receipt.FromString(made.receipt.receipt)))
        listed = pb.StoredRecording.FromString(made.SerializeToString())
        listed.files[0].sha256 = b"x" * 32
        longer = pb.StoredRecording.FromString(made.SerializeToString())
        longer.files.add(name="more", size=0, sha256=b"x" * 32)
        for wrong, why in (
            (forged, "its receipt is unknown key"),
            (pb.StoredRecording(recording=made.recording), "its receipt is no receipt"),
            (listed, "are not those that were verified"),
            (longer, "are not those that were verified"),
        ):
            await hub.put(names.RECORDINGS, f"{ROBOT}.one", wrong.SerializeToString())
            refused = await laptop.get()
            assert refused.returncode == 1
            assert why in refused.stderr
        await hub.put(names.RECORDINGS, f"{ROBOT}.one", b"\xff\xff")
        assert "unreadable" in (await laptop.get()).stderr
        assert not laptop.folder.exists()
        assert not ground.proxy.ranges, "nothing was read"


async def test_a_recording_of_many_files_is_read_by_the_stores_own_list(
    ground: Ground,  # noqa: F811
    laptop: Laptop,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # As with thousands of files, of which the hub's entry has none.
    monkeypatch.setattr(verified, "_MOST_IN_RECORD", 0)
    async with stored(ground):
        done = await laptop.got()
        assert (done["files"], laptop.files()) == (3, FILES)


async def test_without_a_receiver_it_ends_at_once_and_says_what_has_to_run(
    ground: Ground,  # noqa: F811
    laptop: Laptop,
) -> None:
    async with stored(ground):
        pass
    begin_s = asyncio.get_running_loop().time()
    refused = await laptop.get()
    assert refused.returncode == 3
    assert "robot-bridge hub receiver" in refused.stderr
    assert asyncio.get_running_loop().time() - begin_s < 20
    none = await laptop.get(recording="none")
    assert (none.returncode, "the store has no recording none" in none.stderr) == (2, True)


async def test_a_login_from_before_this_command_needs_a_new_one(
    ground: Ground,  # noqa: F811
    secure: SecureHub,  # noqa: F811
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with monkeypatch.context() as earlier:
        earlier.setattr(names, "READING_SUBJECTS", "fleet.*.other.*")
        laptop = Laptop(secure, tmp_path)
    async with stored(ground):
        refused = await laptop.get()
    assert refused.returncode == 1
    assert "do not permit" in refused.stderr
    assert "Ask the hub's administrator for a new login" in refused.stderr
