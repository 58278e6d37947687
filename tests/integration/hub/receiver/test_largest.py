"""Messages at the limit of the hub, and recordings whose lists are beyond it."""

import asyncio
import hashlib
from concurrent.futures import ThreadPoolExecutor

import pytest

from bridge.uploads.problems import RecordingError
from bridge.uploads.receivers import Receivers
from fleet import names
from fleet.connection import Hub, connect
from fleet.errors import HubError, HubReason
from fleet.receipt_keys import confirmed, digest_of, read_signer
from omniseer.fleet.v1 import upload_pb2 as pb
from omniseer.gateway.v1.recording_pb2 import Recording, RecordingFile
from tests.support.secure_hub import SecureHub
from tests.support.upload_ground import Ground
from tests.support.uploading import FLEET, ROBOT, running_receiver

LARGEST = names.LARGEST_MESSAGE


async def test_the_largest_message_is_taken_and_a_larger_one_costs_no_connection(
    ground: Ground, secure: SecureHub
) -> None:
    address = secure.address(secure.path / "receiver" / "receiver.creds")
    async with connect(address) as hub:
        await hub.connected(20)
        await hub.put(names.RECORDINGS, f"{ROBOT}.largest", bytes(LARGEST))
        await refused_as_too_large(hub, names.RECORDINGS, bytes(LARGEST + 1))
        await hub.put(names.RECORDINGS, f"{ROBOT}.largest", b"")
    subject = names.event_subject(ROBOT, "run", 1)
    await ground.hub.publish_once(subject, bytes(LARGEST))
    with pytest.raises(HubError) as error:
        await ground.hub.publish_once(names.event_subject(ROBOT, "run", 2), bytes(LARGEST + 1))
    assert error.value.reason is HubReason.TOO_LARGE
    assert ground.hub.link.connections == 1


async def refused_as_too_large(hub: Hub, bucket: str, value: bytes) -> None:
    with pytest.raises(HubError) as error:
        await hub.put(bucket, f"{ROBOT}.larger", value)
    assert error.value.reason is HubReason.TOO_LARGE
    assert hub.link.connections == 1


async def test_a_recording_whose_list_is_too_long_for_the_hub_is_verified(
    ground: Ground, secure: SecureHub
) -> None:
    files = [file(number) for number in range(1800)]
    sizes = [each.ByteSize() for each in files]
    assert LARGEST < sum(sizes) < LARGEST + LARGEST // 2, "too long for the hub, by less than half"
    await verified_before(ground, secure, files)
    recording = Recording(id="one", size=len(files), sha256=digest_of(files))
    async with running_receiver(ground.receivers[0]):
        receipt = await Receivers(ground.hub, ROBOT).complete_upload(recording, [each.name for each in files])
    expected = pb.Receipt(
        fleet=FLEET, robot=ROBOT, recording_id="one", size=recording.size, sha256=recording.sha256
    )
    confirmed(receipt, ground.keys, expected)
    async with connect(secure.administrator()) as hub:
        await hub.connected(20)
        listed = pb.StoredRecording.FromString((await hub.entries(names.RECORDINGS))[f"{ROBOT}.one"].value)
    assert listed.receipt == receipt
    assert not listed.files, "they are in the store's own entry"


async def test_a_recording_that_is_too_large_is_refused_and_costs_no_connection(
    ground: Ground, secure: SecureHub
) -> None:
    large = Recording(id="one", notes="x" * LARGEST, size=1, sha256=b"s" * 32)
    async with running_receiver(ground.receivers[0]):
        receivers = Receivers(ground.hub, ROBOT)
        with pytest.raises(RecordingError, match="too large"):
            await receivers.complete_upload(large, ["data.bin"])
        with pytest.raises(RecordingError, match="too large"):
            await receivers.begin_upload(large)
        # The request still goes through; the list with its receipt does not.
        one = RecordingFile(name="a", size=1, sha256=b"s" * 32, final=True)
        await verified_before(ground, secure, [one])
        almost = Recording(id="one", size=1, sha256=digest_of([one]))
        almost.notes = "x" * (LARGEST - almost.ByteSize() - 20)
        with pytest.raises(RecordingError, match="too large"):
            await receivers.complete_upload(almost, [one.name])
    assert ground.hub.link.connections == 1


def file(number: int) -> RecordingFile:
    """A file of one byte with the longest name."""
    return RecordingFile(
        name=f"{number:0255}", size=1, sha256=hashlib.sha256(b"%d" % (number % 8)).digest(), final=True
    )


async def verified_before(ground: Ground, secure: SecureHub, files: list[RecordingFile]) -> None:
    """The files of the recording "one" are in the store, with their receipts."""
    signer = read_signer(secure.path / "receiver" / "receipts.key")
    client, bucket = ground.server.client, ground.store.bucket

    def store(each: RecordingFile) -> None:
        receipt = pb.Receipt(
            fleet=FLEET,
            robot=ROBOT,
            recording_id="one",
            file_name=each.name,
            size=each.size,
            sha256=each.sha256,
        )
        folder = f"{FLEET}/{ROBOT}/one"
        client.put_object(Bucket=bucket, Key=f"{folder}/{each.name}", Body=b"x")
        signed = signer.sign(receipt).SerializeToString()
        client.put_object(Bucket=bucket, Key=f"{folder}.receipts/{each.name}", Body=signed)

    with ThreadPoolExecutor(8) as threads:
        await asyncio.gather(
            *(asyncio.get_running_loop().run_in_executor(threads, store, each) for each in files)
        )
