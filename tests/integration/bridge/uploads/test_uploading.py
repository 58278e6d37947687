"""Recordings go up: to a real S3 over HTTP, by real receivers over a real hub."""

import asyncio
import hashlib
from collections.abc import Callable
from datetime import datetime
from typing import Any

import pytest

from bridge.uploads.queue import Priority, State, Upload
from common.errors import NotFoundError, PreconditionError, TooMuchError
from console.client.errors import Unreachable
from fleet.connection import Entry, connect
from fleet.receipt_keys import confirmed
from omniseer.fleet.v1 import upload_pb2 as pb
from omniseer.gateway.v1 import recording_pb2 as wire
from tests.support.secure_hub import SecureHub
from tests.support.upload_ground import Ground
from tests.support.uploading import (
    FLEET,
    MIB,
    ROBOT,
    Robot,
    Rows,
    content,
    new_signer,
    running_receiver,
    running_uploads,
)

FILES = {
    "data/000000.mcap": content(20 * MIB, 1),
    "data/000001.mcap": content(3 * MIB + 7, 2),
    "empty.txt": b"",
    "metadata.yaml": b"rosbag2_bagfile_information: {}\n",
}
SIZE = sum(map(len, FILES.values()))


def is_in(*states: State) -> Callable[[Upload | None], bool]:
    return lambda upload: upload is not None and upload.state in states


async def stored_recordings(secure: SecureHub) -> dict[str, Entry]:
    async with connect(secure.administrator()) as hub:
        await hub.connected(20)
        return await hub.entries("fleet_recordings")


async def test_a_recording_is_uploaded_read_again_and_confirmed(ground: Ground, secure: SecureHub) -> None:
    robot = Robot()
    robot.add("one", FILES, label="a run")
    async with (
        running_receiver(ground.receivers[0]),
        running_uploads(robot, ground.hub, ground.proxy.host, ground.keys) as running,
    ):
        await running.uploads.enqueue("one")
        await running.until("one", is_in(State.VERIFIED))
        client = ground.server.client
        for name, data in FILES.items():
            key = f"{FLEET}/{ROBOT}/one/{name}"
            assert client.get_object(Bucket=ground.store.bucket, Key=key)["Body"].read() == data
        assert ground.proxy.total == SIZE, "every byte went once"
        entry = (await stored_recordings(secure))["r1.one"]
        stored = pb.StoredRecording.FromString(entry.value)
        assert [file.name for file in stored.files] == sorted(FILES)
        lines = "".join(f"{hashlib.sha256(FILES[name]).hexdigest()}  {name}\n" for name in sorted(FILES))
        digest = hashlib.sha256(lines.encode()).digest()
        expected = pb.Receipt(fleet=FLEET, robot=ROBOT, recording_id="one", size=SIZE, sha256=digest)
        receipt = confirmed(stored.receipt, ground.keys, expected)
        assert receipt.location.endswith("/lab/r1/one")
        assert stored.recording.label == "a run"
    # A robot that has forgotten all of it gets the receipt at once.
    async with (
        running_receiver(ground.receivers[0]),
        running_uploads(robot, ground.hub, ground.proxy.host, ground.keys) as running,
    ):
        await running.uploads.enqueue("one")
        await running.until("one", is_in(State.VERIFIED))
        assert ground.proxy.total == SIZE


@pytest.mark.parametrize("damage", [None, b"cut short"])
async def test_a_receipt_counts_as_long_as_its_bytes_are_there(ground: Ground, damage: bytes | None) -> None:
    robot, key = Robot(), f"{FLEET}/{ROBOT}/one/data/000001.mcap"
    robot.add("one", FILES)
    client, bucket = ground.server.client, ground.store.bucket
    for _ in range(2):
        # Each time the robot has forgotten that it was verified.
        async with (
            running_receiver(ground.receivers[0]),
            running_uploads(robot, ground.hub, ground.proxy.host, ground.keys) as running,
        ):
            await running.uploads.enqueue("one")
            await running.until("one", is_in(State.VERIFIED))
        assert client.get_object(Bucket=bucket, Key=key)["Body"].read() == FILES["data/000001.mcap"]
        client.delete_object(Bucket=bucket, Key=key)
        if damage is not None:
            client.put_object(Bucket=bucket, Key=key, Body=damage)
    assert ground.proxy.total == SIZE + len(FILES["data/000001.mcap"]), "only what was missing is sent again"


async def test_an_expired_url_is_renewed(ground: Ground) -> None:
    robot = Robot()
    robot.add("one", {"data.bin": content(20 * MIB)})
    for early in (True, False):
        ground.proxy.early = early
        ground.proxy.answers.extend((None, (403, "AccessDenied")))
    async with (
        running_receiver(ground.receivers[0]),
        running_uploads(robot, ground.hub, ground.proxy.host, ground.keys) as running,
    ):
        await running.uploads.enqueue("one")
        await running.until("one", is_in(State.VERIFIED))
        assert running.uploads.cuts == 0
    assert not ground.proxy.answers
    assert ground.proxy.passed == [1, 2, 3]


async def test_a_refusal_before_the_body_is_read_holds_nothing_up(ground: Ground) -> None:
    robot = Robot()
    robot.add("one", {"data.bin": content(9 * MIB)})
    ground.proxy.early = True
    ground.proxy.answers.append((403, "AccessDenied"))
    async with (
        running_receiver(ground.receivers[0]),
        running_uploads(robot, ground.hub, ground.proxy.host, ground.keys) as running,
    ):
        await running.uploads.enqueue("one")
        await running.until("one", is_in(State.VERIFIED), 15)


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        ((507, "InsufficientStorage"), "the fleet's store has no room"),
        ((400, "QuotaExceeded"), "the fleet's store has no room"),
        ((503, "SlowDown"), "503 SlowDown"),
        ((307, "TemporaryRedirect"), "307"),
    ],
)
async def test_a_store_that_refuses_is_tried_again(
    ground: Ground, answer: tuple[int, str], words: str
) -> None:
    robot = Robot()
    robot.add("one", {"data.bin": content(MIB)})
    ground.proxy.answers.append(answer)
    async with (
        running_receiver(ground.receivers[0]),
        running_uploads(robot, ground.hub, ground.proxy.host, ground.keys) as running,
    ):
        await running.uploads.enqueue("one")
        failed = await running.until("one", is_in(State.FAILED))
        assert failed
        assert words in failed.reason
        await running.until("one", is_in(State.VERIFIED))
        assert running.uploads.cuts == 1


async def test_a_recording_that_the_store_refuses_for_ever_holds_up_no_other(ground: Ground) -> None:
    robot = Robot()
    robot.add("poison", {"data.bin": b"x"}, kind=wire.RECORDING_KIND_INCIDENT)
    for number in range(3):
        robot.add(f"good-{number}", {"data.bin": b"data"})
    ground.proxy.refused = "/poison/"
    async with (
        running_receiver(ground.receivers[0]),
        running_uploads(robot, ground.hub, ground.proxy.host, ground.keys) as running,
    ):
        for recording_id in robot.recordings:
            await running.uploads.enqueue(recording_id)
        for number in range(3):
            await running.until(f"good-{number}", is_in(State.VERIFIED))
        poison = await running.until("poison", is_in(State.FAILED))
        assert poison
        assert "400 InvalidRequest" in poison.reason
        ground.proxy.refused = ""
        await running.until("poison", is_in(State.VERIFIED))


async def test_wrong_bytes_are_deleted_and_sent_again(ground: Ground) -> None:
    robot = Robot()
    robot.add("one", {"data.bin": content(9 * MIB)})
    ground.proxy.damage = 2
    async with (
        running_receiver(ground.receivers[0]),
        running_uploads(robot, ground.hub, ground.proxy.host, ground.keys) as running,
    ):
        await running.uploads.enqueue("one")
        failed = await running.until("one", is_in(State.FAILED, State.VERIFIED))
        assert failed
        assert failed.state is State.FAILED, "wrong bytes never become VERIFIED"
        assert "other bytes" in failed.reason
        assert not ground.server.client.list_objects_v2(Bucket=ground.store.bucket).get("Contents")
        await running.until("one", is_in(State.VERIFIED))
    assert ground.proxy.passed == [1, 2, 1, 2]


async def test_a_receipt_of_another_key_verifies_nothing(ground: Ground) -> None:
    robot = Robot()
    robot.add("one", {"data.bin": b"data"})
    async with (
        running_receiver(ground.receivers[0]),
        running_uploads(robot, ground.hub, ground.proxy.host, (new_signer().public_key,)) as running,
    ):
        await running.uploads.enqueue("one")
        failed = await running.until("one", is_in(State.FAILED, State.VERIFIED))
        assert failed
        assert failed.state is State.FAILED
        assert "a key that receipts.pub does not have" in failed.reason


async def test_a_gateway_that_fails_is_a_cut_and_costs_no_part_that_was_sent(ground: Ground) -> None:
    robot = Robot(failure=Unreachable("no robot gateway reached"), fails_at=9 * MIB)
    robot.add("one", {"data.bin": content(20 * MIB)})
    async with (
        running_receiver(ground.receivers[0]),
        running_uploads(robot, ground.hub, ground.proxy.host, ground.keys) as running,
    ):
        await running.uploads.enqueue("one")
        failed = await running.until("one", is_in(State.FAILED))
        assert failed
        assert failed.reason == "the robot's gateway: no robot gateway reached"
        await running.until("one", is_in(State.VERIFIED))
    assert robot.opened == [0, 8 * MIB]


async def test_a_recording_that_is_deleted_meanwhile_leaves_the_queue(ground: Ground) -> None:
    robot = Robot(failure=Unreachable("cut"), fails_at=MIB)
    robot.add("one", {"data.bin": content(9 * MIB)})
    async with (
        running_receiver(ground.receivers[0]),
        running_uploads(robot, ground.hub, ground.proxy.host, ground.keys) as running,
    ):
        await running.uploads.enqueue("one")
        await running.until("one", is_in(State.FAILED))
        robot.delete("one")
        await running.until("one", lambda upload: upload is None)
        assert not running.rows.rows


async def test_requests_that_can_t_be_carried_out_are_refused(ground: Ground) -> None:
    robot = Robot()
    robot.add("running", {"data.bin": b"x"}, state=wire.RECORDING_STATE_RECORDING)
    robot.add("one", {"data.bin": b"x"})
    rows = Rows()
    async with running_uploads(robot, ground.hub, ground.proxy.host, ground.keys, rows) as running:
        with pytest.raises(NotFoundError):
            await running.uploads.enqueue("none")
        with pytest.raises(PreconditionError):
            await running.uploads.enqueue("running")
        with pytest.raises(NotFoundError):
            await running.uploads.cancel("one")
        rows.full = True
        with pytest.raises(TooMuchError, match="disk"):
            await running.uploads.enqueue("one")
        assert running.upload("one") is None


async def test_without_a_receiver_it_waits_and_says_so(ground: Ground) -> None:
    robot = Robot()
    robot.add("one", {"data.bin": b"data"})
    async with running_uploads(robot, ground.hub, ground.proxy.host, ground.keys) as running:
        await running.uploads.enqueue("one")
        failed = await running.until("one", is_in(State.FAILED))
        assert failed
        assert failed.reason == "no receiver of recordings runs at the hub"
        cancelled = await running.uploads.cancel("one")
        assert cancelled.state is not State.VERIFIED
        await running.uploads.consider(robot.recordings.values())
        assert not running.uploads.queue.waiting, "what was cancelled is not queued again by a rule"


async def test_the_rule_queues_in_order_and_the_most_urgent_goes_first(ground: Ground) -> None:
    robot = Robot()
    kinds: dict[str, dict[str, Any]] = {
        "other-new": {"started_unix_ms": 9},
        "other-old": {"started_unix_ms": 2},
        "pinned": {"pinned": True},
        "incident": {"kind": wire.RECORDING_KIND_INCIDENT, "started_unix_ms": 8},
        "bundle": {"kind": wire.RECORDING_KIND_RUN_BUNDLE, "started_unix_ms": 3},
        "running": {"state": wire.RECORDING_STATE_RECORDING},
    }
    for name, more in kinds.items():
        robot.add(name, {"data.bin": name.encode()}, **more)
    rows = Rows()
    order: list[str] = []
    async with running_uploads(
        robot, ground.hub, ground.proxy.host, ground.keys, rows, rule="all", only_while_charging=True
    ) as running:
        await running.uploads.consider(robot.recordings.values())
        order = [each.recording_id for each in running.uploads.queue.waiting]
    assert order == ["incident", "pinned", "other-old", "bundle", "other-new"]
    # The next run finds them on the disk.
    async with (
        running_receiver(ground.receivers[0]),
        running_uploads(robot, ground.hub, ground.proxy.host, ground.keys, rows, rule="all") as running,
    ):
        for name in order:
            await running.until(name, is_in(State.VERIFIED))
        assert [each.recording_id for each in reversed(running.uploads.queue.settled)] == order
        # A folder of experiments has grown: what is new is sent, too.
        robot.add("bundle", {"data.bin": b"bundle", "more.bin": b"more"}, kind=wire.RECORDING_KIND_RUN_BUNDLE)
        await running.uploads.consider(robot.recordings.values())
        assert [each.recording_id for each in running.uploads.queue.waiting] == ["bundle"]
        await running.until("bundle", is_in(State.VERIFIED))


async def test_gates_open_and_close_while_it_runs(ground: Ground) -> None:
    robot = Robot()
    robot.add("one", {"data.bin": content(20 * MIB)})
    charging: list[bool | None] = [None]
    async with (
        running_receiver(ground.receivers[0]),
        running_uploads(
            robot,
            ground.hub,
            ground.proxy.host,
            ground.keys,
            charging=lambda: charging[0],
            only_while_charging=True,
            max_bytes_per_s=6 * MIB,
        ) as running,
    ):
        await running.uploads.enqueue("one")
        paused = await running.until("one", is_in(State.PAUSED))
        assert paused
        assert paused.reason == running.uploads.paused
        assert "not known whether" in paused.reason
        charging[0] = True
        await running.until("one", lambda upload: upload is not None and upload.bytes_done >= 8 * MIB)
        charging[0] = False
        paused = await running.until("one", is_in(State.PAUSED), 5)
        assert paused
        assert "not charging" in paused.reason
        before = ground.proxy.passed.copy()
        charging[0] = True
        await running.until("one", is_in(State.VERIFIED))
        assert running.uploads.paused == ""
    assert ground.proxy.passed[: len(before)] == before
    assert sorted(ground.proxy.passed) == [1, 2, 3], "no part that was there is sent twice"


async def test_an_urgent_recording_takes_the_place_of_another(ground: Ground) -> None:
    robot = Robot()
    robot.add("long", {"data.bin": content(30 * MIB)})
    robot.add("incident", {"data.bin": b"data"}, kind=wire.RECORDING_KIND_INCIDENT)
    async with (
        running_receiver(ground.receivers[0]),
        running_uploads(
            robot, ground.hub, ground.proxy.host, ground.keys, max_bytes_per_s=12 * MIB
        ) as running,
    ):
        await running.uploads.enqueue("long")
        await running.until("long", is_in(State.UPLOADING))
        queued = await running.uploads.enqueue("incident")
        assert queued.priority is Priority.INCIDENT
        await running.until("incident", is_in(State.VERIFIED))
        long = running.upload("long")
        assert long
        assert long.state is not State.VERIFIED
        await running.until("long", is_in(State.VERIFIED))
    assert ground.proxy.total - 30 * MIB <= 8 * MIB + 4


@pytest.mark.timed
async def test_the_cap_is_kept_within_ten_percent(ground: Ground) -> None:
    robot = Robot()
    robot.add("one", {"data.bin": content(16 * MIB)})
    loop = asyncio.get_running_loop()
    async with (
        running_receiver(ground.receivers[0]),
        running_uploads(
            robot, ground.hub, ground.proxy.host, ground.keys, max_bytes_per_s=2 * MIB
        ) as running,
    ):
        await running.uploads.enqueue("one")
        began_s = loop.time()
        await running.until("one", is_in(State.VERIFYING, State.VERIFIED))
        took_s = loop.time() - began_s
    assert took_s >= 16 / 2 * 0.9, "not faster than the cap"
    assert 16 / took_s <= 2 * 1.1


async def test_two_receivers_answer_the_same_robot(ground: Ground) -> None:
    robots = Robot()
    for number in range(4):
        robots.add(f"rec-{number}", {"data.bin": content(9 * MIB, number), "more.bin": b"%d" % number})
    async with (
        running_receiver(ground.receivers[0]),
        running_receiver(ground.receivers[1]),
        running_uploads(robots, ground.hub, ground.proxy.host, ground.keys) as running,
        running_uploads(robots, ground.hub, ground.proxy.host, ground.keys) as twin,
    ):
        # The twin is the same robot once more: both race for the same files.
        for number in range(4):
            await running.uploads.enqueue(f"rec-{number}")
            await twin.uploads.enqueue(f"rec-{number}")
        for number in range(4):
            for each in (running, twin):
                await each.until(f"rec-{number}", is_in(State.VERIFIED), 60)
    for number in range(4):
        key = f"{FLEET}/{ROBOT}/rec-{number}/data.bin"
        found = ground.server.client.get_object(Bucket=ground.store.bucket, Key=key)["Body"].read()
        assert found == content(9 * MIB, number)


async def test_nothing_is_sent_outside_the_hours(ground: Ground) -> None:
    robot = Robot()
    robot.add("one", {"data.bin": b"data"})
    now = datetime.now().astimezone()
    hours = f"{(now.hour + 2) % 24:02}:00-{(now.hour + 3) % 24:02}:00"
    async with (
        running_receiver(ground.receivers[0]),
        running_uploads(robot, ground.hub, ground.proxy.host, ground.keys, hours=(hours,)) as running,
    ):
        await running.uploads.enqueue("one")
        paused = await running.until("one", is_in(State.PAUSED))
        assert paused
        assert hours in paused.reason
    assert ground.proxy.total == 0
