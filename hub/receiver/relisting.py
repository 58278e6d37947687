"""Lists at the hub again what the store has verified: a hub that loses its disk loses that list."""

import asyncio
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import islice
from typing import Final

from common.errors import UserError
from fleet.connection import FleetAddress, connect
from fleet.names import ROBOT_NAME
from hub.receiver.app import party_of
from hub.receiver.config import ReceiverSettings
from hub.receiver.keys import BadNameError
from hub.receiver.store import Store, StoreError
from hub.receiver.verified import THREADS, Refusal, StoreCalls, Verified

MOST: Final = 100_000
"""Recordings of one run; a console reads no more of the list."""
_CONNECT_S: Final = 5.0


@dataclass(frozen=True, slots=True)
class Relisted:
    """What became of the recordings in the store.

    Attributes:
        listed: that are verified, and are in the hub's list now.
        left_out: whose receipt does not count, or whose files are not all there; as ROBOT/ID.
    """

    listed: int
    left_out: tuple[str, ...]


async def relist(settings: ReceiverSettings) -> Relisted:
    """Puts every verified recording of the store into the hub's list; those that are there stay so.

    Raises:
        UserError: The store does not answer, or the hub has no room; what was listed until then stays.
        HubError: The hub does not answer.
    """
    address = FleetAddress(
        settings.hub.servers, settings.hub.credentials, settings.hub.ca, name=f"relisting of {settings.fleet}"
    )
    store = Store(settings.store)
    try:
        with ThreadPoolExecutor(THREADS, thread_name_prefix="store") as threads:
            async with connect(address) as hub:
                await hub.connected(_CONNECT_S)
                verified = Verified(party_of(settings), store, hub, StoreCalls(threads))
                return await _relist(verified, store, settings.fleet)
    except (StoreError, Refusal) as error:
        raise UserError(
            f"not all recordings could be listed: {error}", "Repeat it, it begins anew"
        ) from error
    finally:
        store.close()


async def _relist(verified: Verified, store: Store, fleet: str) -> Relisted:
    found = await asyncio.to_thread(lambda: list(islice(store.recordings(f"{fleet}/"), MOST)))
    listed, left_out = 0, []
    for robot, recording_id in found:
        try:
            counts = bool(ROBOT_NAME.fullmatch(robot)) and await verified.list_again(robot, recording_id)
        except BadNameError:
            counts = False
        if counts:
            listed += 1
        else:
            left_out.append(f"{robot}/{recording_id}")
    return Relisted(listed, tuple(left_out))
