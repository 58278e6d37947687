"""`robot-bridge hub receiver`: runs a receiver."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from common import config, logs, program
from hub.receiver.config import ReceiverSettings

Config = Annotated[
    Path | None,
    typer.Option(
        "--config",
        envvar="ROBOT_RECEIVER_CONFIG",
        help="YAML file; default: RECEIVER__... variables.",
    ),
]


def receiver(config_file: Config = None) -> None:
    """Receives recordings of the fleet until Ctrl-C. Several may run side by side."""
    settings = config.load(ReceiverSettings, config_file)
    logs.configure(settings.log_level, settings.log_format)
    # boto3 takes half a second to import.
    from hub.receiver.app import serve  # noqa: PLC0415

    program.run(partial(serve, settings))
