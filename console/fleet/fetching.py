"""What the hub has of one recording, and where its store has the files."""

import ssl
from dataclasses import replace
from pathlib import Path
from typing import Final

from common.errors import ExitCode, UserError
from common.printable import printable
from console.client import results
from console.client.errors import GatewayFailed, Refused, Unreachable
from console.client.mapping.reader import read
from console.client.results import RecordingFile
from console.fleet.hub import recording_entry
from console.fleet.receipts import check_receipt
from console.fleet.store import read_whole, usable
from console.fleet.values import ReceiptCheck, Unreadable
from console.fleet.wire import recording_of
from fleet import names
from fleet.connection import Hub
from fleet.errors import HubError, HubReason
from fleet.reading import LARGEST_ENTRY, NotReadableError, receiver_answer, store_entry
from fleet.receipt_keys import digest_of
from omniseer.fleet.v1 import upload_pb2 as pb
from omniseer.gateway.v1.recording_pb2 import RecordingFile as RecordingFileMessage

_RECEIVERS: Final = "Receivers answer that, robot-bridge hub receiver: one has to run (docs/uploads.md)"
_ANSWER_S: Final = 20.0
"""A receiver asks the store before it answers."""
_LIST: Final = "Type: robotctl fleet recordings"


class ReceiverUrls:
    """URLs of a recording's files, which receivers sign.

    Args:
        hub: The hub.
        robot: Whose recording it is.
        recording_id: Which.
    """

    def __init__(self, hub: Hub, robot: str, recording_id: str) -> None:
        self._hub, self._robot, self._recording_id = hub, robot, recording_id
        self._known: dict[str, str] = {}

    async def url(self, name: str) -> str:
        """Returns the URL of a file; of the recording's entry without a name.

        Raises:
            GatewayError: No receiver answers, or it refuses.
            HubError: The hub does not permit the request.
        """
        if name not in self._known:
            # A URL is good for some minutes, and a file may take longer: one at a time.
            self._known = {name: await self._requested(name)}
        return self._known[name]

    def forget(self, name: str) -> None:
        """Makes the next call request a new URL."""
        self._known.pop(name, None)

    async def _requested(self, name: str) -> str:
        request = pb.GetFilesRequest(recording_id=self._recording_id, file_names=[name] if name else [])
        subject = names.reading_subject(self._robot, "get_files")
        try:
            answer = await self._hub.request(subject, request.SerializeToString(), _ANSWER_S)
            response = receiver_answer(answer)
        except HubError as error:
            if error.reason is HubReason.REFUSED:
                raise  # The login does not permit it, and will not.
            raise Unreachable(f"no receiver says where the recording is: {error}", _RECEIVERS) from error
        except NotReadableError as error:
            raise GatewayFailed(f"a receiver's answer is unreadable: {error}") from error
        if response.HasField("error"):
            raise _refusal(response.error)
        urls = [each.url for each in response.get_files.urls if each.file_name == name]
        if len(urls) != 1:
            raise GatewayFailed("a receiver's answer is not for the file that was requested")
        return urls[0]


async def read_verified(
    hub: Hub, fleet: str, receivers: tuple[bytes, ...], *, robot: str, recording_id: str, tls: ssl.SSLContext
) -> results.Recording:
    """Returns a recording of the store with all of its files, as its receipt confirms them.

    Args:
        hub: The hub.
        fleet: Its name, which the receipt has to have.
        receivers: Ed25519 public keys of the fleet's receivers, 32 bytes each.
        robot: Whose recording.
        recording_id: Which.
        tls: For the store's certificate.

    Raises:
        UserError: There is none, it is not verified, or its list of files is not the one that was.
        HubError: The hub does not answer.
    """
    entry = await recording_entry(hub, robot, recording_id)
    if entry is None:
        raise UserError(
            f"the store has no recording {printable(recording_id)} of {printable(robot)}",
            _LIST,
            exit_code=ExitCode.USAGE,
        )
    found = recording_of(entry.key, entry.value)
    if isinstance(found, Unreadable):
        raise UserError(f"the hub's entry of {recording_id} is unreadable: {found.problem}")
    recording, _, message = found
    checked = check_receipt(message, fleet, robot, receivers)
    if checked.result is not ReceiptCheck.VALID:
        raise UserError(
            f"{recording.id} is not verified: its receipt is {checked.result.value}",
            "Nothing is copied: it may not be what the robot has recorded",
        )
    files = list(message.files)
    if not files:
        files = await _all_files(ReceiverUrls(hub, robot, recording_id), tls)
    size = sum(file.size for file in files)
    if not files or digest_of(files) != message.recording.sha256 or size != message.recording.size:
        raise UserError(
            f"the files that are listed of {recording.id} are not those that were verified",
            "Nothing is copied; ask who administers the hub",
        )
    # What was verified is final, whatever the entry says of that.
    return replace(recording, files=tuple(replace(read(RecordingFile, file), final=True) for file in files))


async def _all_files(urls: ReceiverUrls, tls: ssl.SSLContext) -> list[RecordingFileMessage]:
    """Returns the files of a recording that has too many for the hub's entry: from the store's own."""
    content = await read_whole(usable(await urls.url("")), tls, LARGEST_ENTRY)
    try:
        return list(store_entry(content).files)
    except NotReadableError as error:
        raise GatewayFailed(f"the store's list of the recording's files is unreadable: {error}") from error


def tls_context(authority: Path | None) -> ssl.SSLContext:
    """Returns what checks the store's certificate.

    Args:
        authority: PEM file of its authority; None: those that the system trusts.

    Raises:
        UserError: The file can't be read, or has no certificate.
    """
    try:
        return ssl.create_default_context(cafile=authority)
    except (OSError, ssl.SSLError) as error:
        raise UserError(
            f"{authority} is no certificate of an authority: {error.strerror or error}",
            "Name a PEM file: --store-ca FILE",
            exit_code=ExitCode.USAGE,
        ) from error


def _refusal(error: pb.UploadError) -> Refused | Unreachable:
    text = f"a receiver refuses: {printable(error.message)}"
    if error.code in (pb.UPLOAD_ERROR_CODE_STORE, pb.UPLOAD_ERROR_CODE_BUSY):
        return Unreachable(text, "Try again")
    return Refused(text)
