"""The key that receivers sign receipts with, replaced: old ones count until they are retired.

| what happens | what follows |
|---|---|
| a receiver uses the new key, a robot the old receipts.pub | its upload fails until it has the new one |
| it is interrupted | receipts.pub is written first: it lacks no key that signs |
"""

from typing import Final

from common.errors import UserError
from common.private_files import write_all_private
from fleet.receipt_keys import ReceiptSigner, as_text, new_seed, read_public_keys, read_signer
from hub.directory import HubDirectory

MOST_KEYS: Final = 8
"""That count at once."""


def rotate(directory: HubDirectory) -> int:
    """Makes a new key, with which receivers are to sign; returns how many public keys count now.

    Raises:
        UserError: There is no hub in the directory, too many keys count already, or a file can't be written.
    """
    with directory.locked():
        directory.read()
        known = read_public_keys(directory.path / "receipts.pub")
        if len(known) >= MOST_KEYS:
            raise UserError(
                f"{len(known)} keys count already, and more are not checked",
                f"Retire the old ones first: robot-bridge hub receipts retire --dir {directory.path}",
            )
        seed = new_seed()
        keys = (ReceiptSigner(seed).public_key, *known)
        write_all_private(
            {
                directory.path / "receipts.pub": as_text(keys).encode(),
                directory.path / "receipts.key": as_text([seed]).encode(),
            }
        )
        return len(keys)


def retire(directory: HubDirectory) -> int:
    """Leaves the newest key alone in receipts.pub; returns how many do not count any more.

    Raises:
        UserError: There is no hub in the directory, or a file can't be read or written.
    """
    with directory.locked():
        directory.read()
        newest = read_signer(directory.path / "receipts.key").public_key
        old = [each for each in read_public_keys(directory.path / "receipts.pub") if each != newest]
        write_all_private({directory.path / "receipts.pub": as_text([newest]).encode()})
        return len(old)
