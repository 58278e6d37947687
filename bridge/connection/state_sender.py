"""Puts the robot's state into the hub's bucket: the newest one wins, and none is kept for later."""

import asyncio
import logging
import time

from bridge.connection.robot_state import MIN_INTERVAL_S, Own, due_in_s, robot_state, same_but_for_time
from bridge.connection.uploading import Uploading
from bridge.outbox.outbox import Outbox
from bridge.robot.status import StatusReader
from common.jittered_backoff import JitteredBackoff
from common.version import project_version
from fleet.connection import Hub
from fleet.errors import HubError
from fleet.names import STATES
from omniseer.fleet.v1.state_pb2 import RobotState

_log = logging.getLogger(__name__)


class StateSender:
    """Sends until cancelled.

    Args:
        robot: its name in the fleet.
        gateway_target: where operators reach the gateway; empty if it is not to be known.
        run_id: of this run of the bridge.
        status: the gateway's.
        outbox, uploads: what is said of them.
        hub: takes the state.
    """

    def __init__(
        self,
        robot: str,
        gateway_target: str,
        run_id: str,
        *,
        status: StatusReader,
        outbox: Outbox,
        uploads: Uploading,
        hub: Hub,
    ) -> None:
        self._robot, self._gateway_target, self._run_id = robot, gateway_target, run_id
        self._status, self._outbox, self._uploads, self._hub = status, outbox, uploads, hub
        self._version = project_version()
        self.sent = 0
        """Values that the bucket took."""
        self.failures = 0
        """Attempts that failed."""

    async def run(self) -> None:
        """Sends on a change at most once a second, otherwise every 10 s."""
        backoff = JitteredBackoff()
        last, sent_s = b"", float("-inf")
        while True:
            await self._hub.connected()
            state = self._state()
            key = same_but_for_time(state)
            wait_s = due_in_s(changed=key != last, since_sent_s=time.monotonic() - sent_s)
            if wait_s > 0:
                # A state is looked at once a second; nothing in it is worth a message sooner.
                await asyncio.sleep(min(wait_s, MIN_INTERVAL_S))
                continue
            try:
                await self._put(state)
            except HubError as error:
                self.failures += 1
                _log.info("the robot's state was not taken: %s", error)
                await self._hub.pause(backoff.next_s())
            else:
                last, sent_s = key, time.monotonic()
                backoff.reset()

    async def _put(self, state: RobotState) -> None:
        state.bridge_run_id = self._run_id
        state.sequence = self.sent + 1
        state.wall_clock_unix_ms = time.time_ns() // 1_000_000
        await self._hub.put(STATES, self._robot, state.SerializeToString())
        self.sent += 1

    def _state(self) -> RobotState:
        facts = self._outbox.facts
        own = Own(
            robot=self._robot,
            bridge_version=self._version,
            gateway_target=self._gateway_target,
            gateway_reachable=self._status.reachable,
            outbox_events=facts.events,
            events_dropped=facts.dropped,
            uploads=tuple(self._uploads.briefs()),
        )
        return robot_state(own, self._status.newest)
