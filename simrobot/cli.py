"""The simulated robot: `simrobot run` starts one, `simrobot control` changes a running one."""

import json
from enum import Enum
from pathlib import Path
from typing import Annotated, Any

import typer

from common import program
from common.ros_environment import check_domain, check_middleware
from simrobot import control as control_socket
from simrobot.behaviour import COMMANDS, Behaviour, Topic
from simrobot.rates import COMMANDS_HZ, DEFAULT_RATES_HZ

app = typer.Typer(help=__doc__, add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False)

ControlPath = Annotated[
    Path | None,
    typer.Option("--control", help="The control socket. By default one per user and ROS domain."),
]


def _rate(what: str) -> Any:
    return typer.Option(min=0.0, max=2000.0, help=f"How often {what} published; 0: never.")


@app.command()
def run(  # noqa: PLR0917 - typer makes the command line from the signature
    odometry_hz: Annotated[float, _rate("odometry is")] = DEFAULT_RATES_HZ[Topic.ODOMETRY],
    vision_hz: Annotated[float, _rate("vision is")] = DEFAULT_RATES_HZ[Topic.VISION],
    detections_hz: Annotated[float, _rate("detections are")] = DEFAULT_RATES_HZ[Topic.DETECTIONS],
    battery_hz: Annotated[float, _rate("battery is")] = DEFAULT_RATES_HZ[Topic.BATTERY],
    diagnostics_hz: Annotated[float, _rate("diagnostics are")] = DEFAULT_RATES_HZ[Topic.DIAGNOSTICS],
    commands_hz: Annotated[float, _rate("commands, of the driving mux input and the mux, are")] = COMMANDS_HZ,
    mode_hz: Annotated[
        float,
        typer.Option(min=0.0, max=100.0, help="How often a change of the mode is checked for; 0: never."),
    ] = DEFAULT_RATES_HZ[Topic.MODE],
    base: Annotated[
        bool,
        typer.Option(
            "--base",
            envvar="SIMROBOT_BASE",
            help="Follow the velocity commands of the graph, through a mux and a base.",
        ),
    ] = False,
    behaviour: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[FIELD=VALUE]...", help="Behaviour; 'simrobot control --help' lists the fields."
        ),
    ] = None,
    control: ControlPath = None,
) -> None:
    """Publishes the topics of a robot until SIGINT or SIGTERM."""
    rates_hz = {
        Topic.ODOMETRY: odometry_hz,
        Topic.VISION: vision_hz,
        Topic.DETECTIONS: detections_hz,
        Topic.BATTERY: battery_hz,
        Topic.DIAGNOSTICS: diagnostics_hz,
        Topic.MODE: mode_hz,
        **dict.fromkeys(COMMANDS, commands_hz),
    }

    start = Behaviour().changed(_fields(behaviour or []))
    check_domain()
    check_middleware()
    # Late, so that --help and a wrong option need no ROS 2.
    from simrobot.app import run_robot  # noqa: PLC0415

    path = control or control_socket.default_path()
    program.run(lambda stop: run_robot(stop, start, rates_hz, path, with_base=base))


class Action(Enum):
    """What `simrobot control` does with its further arguments."""

    SHOW = "show"
    BASE = "base"
    SILENCE = "silence"
    RESUME = "resume"
    SET = "set"


@app.command("control")
def change(
    action: Annotated[
        Action,
        typer.Argument(help="silence and resume take topics, set takes FIELD=VALUE, show and base nothing."),
    ],
    arguments: Annotated[list[str] | None, typer.Argument(metavar="[TOPIC | FIELD=VALUE]...")] = None,
    control: ControlPath = None,
) -> None:
    """Changes a running robot and prints its behaviour as JSON; base prints what its base has received.

    Fields: silent, not_a_number (topics, separated by commas), speed_mps, turn_rad_s, infer_errors_per_s,
    detection_count, battery_percent, battery_drain_percent_per_s, commander (keyboard, autonomy, navigation,
    unseen, nobody), mode, components (drive:error,lidar:stale).

    Of the base: when the last velocity other than zero came (moved_s), and the first zero after it (zero_s),
    in seconds of the monotonic clock.
    """
    path = control or control_socket.default_path()
    if action is Action.BASE:
        print(json.dumps(control_socket.ask_base(path), indent=2))
        return
    print(json.dumps(control_socket.ask(path, _request(action, arguments or [], path)), indent=2))


def _request(action: Action, arguments: list[str], path: Path) -> dict[str, Any]:
    if action is Action.SHOW:
        return {}
    if not arguments:
        what = (
            "FIELD=VALUE" if action is Action.SET else f"TOPIC ({', '.join(topic.value for topic in Topic)})"
        )
        raise typer.BadParameter(f"'{action.value}' needs at least one {what}")
    if action is Action.SET:
        return _fields(arguments)
    silent = set(control_socket.ask(path, {})["silent"])
    return {
        "silent": sorted(silent | set(arguments) if action is Action.SILENCE else silent - set(arguments))
    }


def _fields(pairs: list[str]) -> dict[str, Any]:
    """Parses FIELD=VALUE pairs into JSON values; pydantic converts numbers, which stay text here."""
    fields: dict[str, Any] = {}
    for pair in pairs:
        name, equals, value = pair.partition("=")
        if not equals:
            raise typer.BadParameter(f"'{pair}' is not FIELD=VALUE")
        fields[name] = _json_value(name, value)
    return fields


def _json_value(name: str, text: str) -> Any:
    items = [item for item in text.split(",") if item]
    if name in {"silent", "not_a_number"}:
        return items
    if name == "components":
        return {component: level for component, _, level in (item.partition(":") for item in items)}
    return text


def main() -> None:
    """Runs the command line."""
    program.run_command_line(app, "simrobot")
