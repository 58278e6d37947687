"""`robot-bridge doctor`: the configuration, the files, the disk, the gateway, the running program."""

import os
import shutil
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import grpc

from bridge.config import BridgeSettings
from bridge.doctor.judgement import folder_findings, hours_findings, program_findings, settings_findings
from bridge.robot.gateway import credentials, remedy
from bridge.rpc.client import newest_state
from common.config_finding import checked_settings
from common.errors import UserError
from common.findings import Finding, good, note, wrong
from common.start_command import start_command
from console.client import GatewayClient


def examine(config_file: Path | None) -> Iterator[Finding]:
    """Yields the findings on this machine.

    Args:
        config_file: of the program.
    """
    settings = yield from checked_settings(BridgeSettings, config_file, "robot-bridge")
    if settings is None:
        return
    yield from _files(settings)
    yield from settings_findings(settings)
    yield from hours_findings(settings.uploads, datetime.now(UTC))
    existing = next(each for each in (settings.root, *settings.root.parents) if each.exists())
    free_bytes = shutil.disk_usage(existing).free
    yield from folder_findings(settings, free_bytes, writable=os.access(existing, os.W_OK | os.X_OK))
    yield from _gateway(settings)
    try:
        yield from program_findings(newest_state(settings.socket).status)
    except grpc.RpcError as error:
        yield note(
            "bridge",
            f"no bridge answers at {settings.socket}: {error.code().name}",
            "The fleet hears nothing of this robot",
            f"Start it: {start_command('robot-bridge')}",
        )


def _files(settings: BridgeSettings) -> Iterator[Finding]:
    hub = settings.hub
    for key, path in (("credentials", hub.credentials), ("ca", hub.ca), ("receipts", hub.receipts)):
        if path is None:
            continue
        if os.access(path, os.R_OK):
            yield good(f"hub.{key}", f"{path} is there")
        else:
            yield wrong(
                f"hub.{key}",
                f"{path} can't be read by this user",
                "The hub can't be reached without it",
                "Copy it from the robot's enrolment (robot-bridge enroll NAME --out DIR, on the hub)",
            )


def _gateway(settings: BridgeSettings) -> Iterator[Finding]:
    target = settings.gateway.target
    try:
        with GatewayClient(target, credentials=credentials(settings.gateway)) as gateway:
            name = gateway.status().gateway_name
    except UserError as error:
        yield wrong("gateway", error.what, "The fleet sees neither its state nor its events", remedy(error))
    else:
        yield good("gateway", f"{name} answers at {target}")
