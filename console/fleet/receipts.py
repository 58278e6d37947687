"""Whether the receipt of a stored recording is that of a receiver, and of this recording."""

from dataclasses import dataclass

from console.fleet.values import ReceiptCheck
from console.printable import printable
from fleet.receipts import ReceiptError, ReceiptKeys
from omniseer.fleet.v1.upload_pb2 import Receipt, StoredRecording


@dataclass(frozen=True, slots=True)
class CheckedReceipt:
    """What a receipt proves; without a valid one neither time nor place is known."""

    result: ReceiptCheck
    reason: str = ""
    verified_unix_ms: int | None = None
    location: str = ""


def check_receipt(
    stored: StoredRecording, fleet: str, robot: str, keys: ReceiptKeys | None
) -> CheckedReceipt:
    """Returns what the receipt of a stored recording proves.

    Args:
        stored: The recording with its receipt, as the hub has it.
        fleet: Name of the fleet.
        robot: Whose recording it is, by its key.
        keys: Of the fleet's receivers; None if they are not known.
    """
    if not stored.receipt.receipt:
        return CheckedReceipt(ReceiptCheck.MISSING)
    if keys is None:
        return CheckedReceipt(ReceiptCheck.UNCHECKED, "this login has no keys of receivers")
    recording = stored.recording
    expected = Receipt(
        fleet=fleet,
        robot=robot,
        recording_id=recording.id,
        size=recording.size,
        sha256=recording.sha256,
    )
    try:
        receipt = keys.verified(stored.receipt, expected)
    except ReceiptError as error:
        return CheckedReceipt(ReceiptCheck.INVALID, str(error))
    return CheckedReceipt(ReceiptCheck.VALID, "", receipt.verified_unix_ms, printable(receipt.location))
