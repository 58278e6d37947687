"""Whether the receipt of a stored recording is that of a receiver, and of this recording."""

from dataclasses import dataclass
from typing import Final

from common.printable import printable
from console.fleet.values import ReceiptCheck
from fleet.receipts import ReceiptFlaw, opened
from omniseer.fleet.v1.upload_pb2 import Receipt, StoredRecording

_CHECKS: Final = {
    ReceiptFlaw.MISSING: ReceiptCheck.MISSING,
    ReceiptFlaw.UNKNOWN_KEY: ReceiptCheck.UNKNOWN_KEY,
    ReceiptFlaw.INVALID: ReceiptCheck.INVALID,
}


@dataclass(frozen=True, slots=True)
class CheckedReceipt:
    """What a receipt proves; without a valid one neither time nor place is known."""

    result: ReceiptCheck
    verified_unix_ms: int | None = None
    location: str = ""


def check_receipt(
    stored: StoredRecording, fleet: str, robot: str, receivers: tuple[bytes, ...]
) -> CheckedReceipt:
    """Returns what the receipt of a stored recording proves.

    Args:
        stored: The recording with its receipt, as the hub has it.
        fleet: Name of the fleet.
        robot: Whose recording it is, by its key.
        receivers: Public keys of the fleet's receivers.
    """
    receipt = opened(stored.receipt, receivers)
    if isinstance(receipt, ReceiptFlaw):
        return CheckedReceipt(_CHECKS[receipt])
    if not _is_of(receipt, stored, fleet, robot):
        return CheckedReceipt(ReceiptCheck.INVALID)
    return CheckedReceipt(ReceiptCheck.VALID, receipt.verified_unix_ms, printable(receipt.location))


def _is_of(receipt: Receipt, stored: StoredRecording, fleet: str, robot: str) -> bool:
    recording = stored.recording
    said = (receipt.fleet, receipt.robot, receipt.recording_id, receipt.file_name)
    same = (receipt.size, receipt.sha256) == (recording.size, recording.sha256)
    return same and said == (fleet, robot, recording.id, "")
