"""robotctl status and robotctl overlay: one answer of the robot, as a table or as JSON."""

from console.cli.session import Session, with_session
from console.cli.tables import overlay_view, status_view
from console.presentation.json_form import json_form


@with_session
def status(session: Session) -> None:
    """Show the status of the whole robot, once."""
    with session.connect() as gateway:
        answer = gateway.status()
    session.show(json_form(answer), status_view(answer, gateway.target))


@with_session
def overlay(session: Session) -> None:
    """Show the robot's detections and the newest events, once."""
    with session.connect() as gateway:
        answer = gateway.overlay()
    session.show(json_form(answer), overlay_view(answer, gateway.target))
