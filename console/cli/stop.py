"""robotctl stop, robotctl reset-stop."""

from typing import Annotated

import typer

from console.cli.session import Session, with_session

ReasonOption = Annotated[
    str, typer.Option("--reason", metavar="TEXT", help="Why, for people; at most 200 characters.")
]
StopIdArgument = Annotated[
    int, typer.Argument(metavar="STOP_ID", min=1, help="The stop, as `robotctl status` and `stop` name it.")
]


@with_session
def stop(session: Session, *, reason: ReasonOption = "") -> None:
    """Stop the robot until reset-stop, no matter who drives it. Needs the role of a viewer."""
    with session.connect() as gateway:
        stopped = gateway.stop_robot(reason)
    session.show_answer(stopped)


@with_session
def reset_stop(session: Session, *, stop_id: StopIdArgument) -> None:
    """Reset a stop of the robot. Nothing moves by it; a newer stop stays."""
    with session.connect() as gateway:
        done = gateway.reset_stop(stop_id)
    session.show_answer(done)
