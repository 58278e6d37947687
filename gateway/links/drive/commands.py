"""What can't wait for the link's reconciliation: leases, commands, stops, the age of the pictures."""

import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Final

from gateway.links.drive.state import DriveCommand
from gateway.links.drive.wire import DriveClient, DriveConnector, command_message
from gateway.links.watch import SharingConnector
from gateway.status.teleop import LeaseEnd
from omniseer.drive.v1 import drive_pb2 as pb

_log = logging.getLogger(__name__)

ENDS: Final = {
    LeaseEnd.CLOSED: pb.LEASE_END_CLOSED,
    LeaseEnd.LOST: pb.LEASE_END_LOST,
    LeaseEnd.TAKEN_OVER: pb.LEASE_END_TAKEN_OVER,
    LeaseEnd.ACCESS_ENDED: pb.LEASE_END_ACCESS_ENDED,
    LeaseEnd.DISABLED: pb.LEASE_END_CLOSED,
}
"""Total: a test checks it."""


class DriveCommands(SharingConnector[DriveClient]):
    """A connector for the link that uses its connection for the driver's messages as well.

    Every method that sends returns at once: whether the message is on its way; False without a connection.

    Args:
        connector: opens the connections.

    Attributes:
        connection: counts the connections; a lease has to be granted anew to each.
    """

    def __init__(self, connector: DriveConnector) -> None:
        super().__init__(connector)
        self.connection = 0
        self._unconfirmed: pb.ToDrive | None = None
        """The newest stop, until it is confirmed: the first message of each new connection."""

    @asynccontextmanager
    async def connect(self) -> AsyncIterator[DriveClient]:
        """Yields a connection."""
        async with super().connect() as client:
            self.connection += 1
            if self._unconfirmed:
                _log.warning("the stop by %s, not confirmed, is sent again", self._unconfirmed.stop.by)
                client.send(self._unconfirmed)
            yield client

    def grant(self, session_id: str, holder: str, *, line_of_sight: bool, streaming: bool) -> bool:
        """Grants the lease to a session, in place of any other."""
        grant = pb.GrantLease(
            session_id=session_id, holder=holder, line_of_sight=line_of_sight, streaming=streaming
        )
        return self._send(pb.ToDrive(grant=grant))

    def end(self, session_id: str, why: LeaseEnd) -> bool:
        """Ends the lease of a session."""
        return self._send(pb.ToDrive(end=pb.EndLease(session_id=session_id, why=ENDS[why])))

    def command(self, session_id: str, command: DriveCommand) -> bool:
        """Passes a command on."""
        return self._send(command_message(session_id, command))

    def stop(self, by: str, reason: str) -> bool:
        """Stops the robot. Until `stop_confirmed`, each new connection begins with the newest stop."""
        self._unconfirmed = pb.ToDrive(stop=pb.Stop(by=by, reason=reason))
        return self._send(self._unconfirmed)

    def stop_confirmed(self) -> None:
        """Keeps the newest stop no longer; the drive program has it, or a later one."""
        self._unconfirmed = None

    def reset(self, stop_id: int) -> bool:
        """Resets a stop."""
        return self._send(pb.ToDrive(reset=pb.Reset(stop_id=stop_id)))

    def picture(self, newest_capture_ns: int | None) -> bool:
        """Reports an upper bound of when the newest picture was captured that left; None if none leave."""
        picture = pb.Picture(running=newest_capture_ns is not None, newest_capture_ns=newest_capture_ns or 0)
        return self._send(pb.ToDrive(picture=picture))

    def _send(self, message: pb.ToDrive) -> bool:
        return self._client is not None and self._client.send(message)
