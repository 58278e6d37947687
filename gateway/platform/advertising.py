"""Keeps the process that advertises the gateway running."""

import asyncio
import json
import logging
import os
import sys
import time
from contextlib import suppress
from dataclasses import asdict
from typing import Final

from common.advertisement import Advertisement
from common.backoff import Backoff
from common.deadline import within

_log = logging.getLogger(__name__)

_FIRST_PAUSE_S: Final = 1.0
_LONGEST_PAUSE_S: Final = 60.0
_STOPS_WITHIN_S: Final = 2.0
"""It says goodbye to the network."""
_DIES_WITHIN_S: Final = 1.0
"""After a kill, which takes milliseconds, unless the process waits in a driver."""
_GOOD_AFTER_S: Final = 60.0
"""A process that ran for so long failed for a new reason."""


async def advertise(
    advertisement: Advertisement, port: int, host: str, only: tuple[str, ...], module: str = ""
) -> None:
    """Runs the process, again whenever it ends, until it is cancelled. A failure is in the log only.

    Args:
        advertisement: what is announced.
        port: of the gateway.
        host: `grpc.host`.
        only: `discovery.addresses`.
        module: another program than the advertiser, for tests.
    """
    given = {**asdict(advertisement), "port": port, "host": host, "only": only}
    module = module or "gateway.platform.advertiser"
    pauses = Backoff(_FIRST_PAUSE_S, _LONGEST_PAUSE_S)
    while True:
        began_s = time.monotonic()
        problem = await _run_once(module, json.dumps(given))
        if time.monotonic() - began_s > _GOOD_AFTER_S:
            pauses.reset()
        if problem:
            pause_s = pauses.next_s()
            _log.warning(
                "the gateway is not advertised on the network: %s; next attempt in %g s", problem, pause_s
            )
            await asyncio.sleep(pause_s)


async def _run_once(module: str, given: str) -> str:
    """Runs the process to its end; returns why it failed, or nothing where it is only to be started again."""
    try:
        child = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", module, str(os.getpid()), given),
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.DEVNULL,
            stderr=asyncio.subprocess.PIPE,
        )
    except OSError as error:
        return f"its process can't be started: {error.strerror}"
    assert child.stderr is not None  # noqa: S101  # a pipe
    last = b""
    try:
        while line := await _line(child.stderr):
            last = line
        code = await child.wait()
    finally:
        await _stop(child)
    return (last.decode(errors="replace").strip() or f"its process ended with code {code}") if code else ""


async def _line(pipe: asyncio.StreamReader) -> bytes:
    try:
        return await pipe.readline()
    except ValueError:  # longer than the pipe's buffer
        return b"a line without end\n"


async def _stop(child: asyncio.subprocess.Process) -> None:
    if child.returncode is not None:
        return
    child.terminate()
    try:
        await within(_STOPS_WITHIN_S, child.wait())
    except TimeoutError:
        with suppress(ProcessLookupError):
            child.kill()
        try:
            await within(_DIES_WITHIN_S, child.wait())
        except TimeoutError:
            # The gateway's end must not wait for it.
            _log.warning(
                "the process %d that advertises the gateway was killed, but the kernel holds it; "
                "it ends when that lets it go, or with a restart of the computer",
                child.pid,
            )
