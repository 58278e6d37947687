"""The key of receipts is replaced while robots upload: what was confirmed stays so, nothing goes twice."""

import asyncio

from bridge.uploads.queue import State
from fleet.receipt_keys import read_public_keys
from fleet.receipts import opened
from hub import receipts
from hub.receiver.config import ReceiverSettings
from omniseer.fleet.v1 import upload_pb2 as pb
from tests.support.secure_hub import SecureHub
from tests.support.upload_ground import Ground
from tests.support.uploading import FLEET, ROBOT, Robot, running_receiver, running_uploads


async def test_old_and_new_receipts_count_side_by_side(ground: Ground, secure: SecureHub) -> None:
    robot = Robot()
    for name in ("one", "two", "three", "four"):
        robot.add(name, {"data.bin": name.encode()})
    old_receiver = ground.receivers[0]
    await _uploaded(ground, robot, old_receiver, ground.keys, "one")
    await asyncio.to_thread(receipts.rotate, secure.directory)
    public = secure.directory.path / "receipts.pub"
    new_keys = read_public_keys(public)
    # A robot that has the new keys, and a receiver that has not.
    await _uploaded(ground, robot, old_receiver, new_keys, "two")
    assert _signer(ground, "two", ground.keys)
    new_receiver = old_receiver.model_copy(
        update={"signing_key": secure.directory.path / "receipts.key", "receipt_keys": public}
    )
    sent = ground.proxy.total
    await _uploaded(ground, robot, new_receiver, new_keys, "one")
    assert ground.proxy.total == sent, "what the old key has signed is confirmed all the same"
    await _uploaded(ground, robot, new_receiver, new_keys, "three")
    assert _signer(ground, "three", new_keys)
    assert not _signer(ground, "three", ground.keys)
    # A robot that still has the old keys goes on when it gets the new ones.
    async with (
        running_receiver(new_receiver),
        running_uploads(robot, ground.hub, ground.proxy.host, ground.keys) as running,
    ):
        await running.uploads.enqueue("four")
        failed = await running.until("four", lambda each: each and each.state is State.FAILED)
        assert failed
        assert "receipts.pub does not have" in failed.reason
    await _uploaded(ground, robot, new_receiver, new_keys, "four")


async def _uploaded(
    ground: Ground, robot: Robot, receiver: ReceiverSettings, keys: tuple[bytes, ...], name: str
) -> None:
    """A robot that remembers nothing uploads a recording, and it is verified."""
    async with (
        running_receiver(receiver),
        running_uploads(robot, ground.hub, ground.proxy.host, keys) as running,
    ):
        await running.uploads.enqueue(name)
        await running.until(name, lambda each: each and each.state is State.VERIFIED)


def _signer(ground: Ground, name: str, keys: tuple[bytes, ...]) -> bool:
    """Whether one of these keys has signed the receipt of a recording in the store."""
    key = f"{FLEET}/{ROBOT}/{name}.recording"
    body = ground.server.client.get_object(Bucket=ground.store.bucket, Key=key)["Body"].read()
    return isinstance(opened(pb.StoredRecording.FromString(body).receipt, keys), pb.Receipt)
