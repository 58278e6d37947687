"""Sends a state and an event a second with the NATS library alone, until its standard input closes.

    python -m bench.fleet.bare_publisher SERVER FILES ROBOT STATE EVENT

STATE and EVENT are files with the payloads. What any program needs that sends what a bridge does, over TLS
and until the hub has it: no gateway, no outbox, no uploads, nothing that outlives a lost connection.
"""

import asyncio
import itertools
import json
import secrets
import ssl
import sys
from pathlib import Path

import nats

from fleet import names

_PERIOD_S = 1.0
_ANSWER_S = 10.0


async def publish(server: str, files: Path, robot: str, state: bytes, event: bytes) -> None:
    """Sends until the standard input closes.

    Args:
        server: of the hub.
        files: of the robot's enrolment.
        robot: its name.
        state: payload of each state.
        event: payload of each event.
    """
    loop = asyncio.get_running_loop()
    ended = loop.run_in_executor(None, sys.stdin.read)
    hub = await nats.connect(
        server,
        tls=ssl.create_default_context(cafile=files / "ca.pem"),
        user_credentials=files / "bridge.creds",
        inbox_prefix=names.inbox_prefix(robot).encode(),
    )
    print("ready", flush=True)
    run, begun_s = secrets.token_hex(8), loop.time()
    for number in itertools.count(1):
        check_taken((await hub.request(f"$KV.{names.STATES}.{robot}", state, timeout=_ANSWER_S)).data)
        check_taken(
            (await hub.request(names.event_subject(robot, run, number), event, timeout=_ANSWER_S)).data
        )
        done, _ = await asyncio.wait([ended], timeout=max(begun_s + number * _PERIOD_S - loop.time(), 0))
        if done:
            break
    await hub.close()


def check_taken(answer: bytes) -> None:
    """Checks that the hub's answer to a message says that a stream has it.

    Raises:
        RuntimeError: it says something else.
    """
    if "stream" not in json.loads(answer) or "error" in json.loads(answer):
        raise RuntimeError(f"the hub has not taken a message: {answer.decode(errors='replace')}")


if __name__ == "__main__":
    asyncio.run(
        publish(
            sys.argv[1],
            Path(sys.argv[2]),
            sys.argv[3],
            Path(sys.argv[4]).read_bytes(),
            Path(sys.argv[5]).read_bytes(),
        )
    )
