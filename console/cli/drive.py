"""robotctl drive: drives the robot by the keys of this terminal or by a gamepad, within sight of it."""

import asyncio
import time
from typing import Annotated, Any, Final

import typer

from common.errors import ExitCode, UserError
from common.tasks import cancel
from console.cli import drive_terminal
from console.cli.drive_input import Controls, Input, controls
from console.cli.drive_keys import Action, Hands
from console.cli.keyboard import Keyboard, has_keyboard
from console.cli.loop_signals import ENDING, handled
from console.cli.session import Session, print_json, with_session
from console.client import (
    AsyncGatewayClient,
    DriveOptions,
    DrivePhase,
    DriveSession,
    DriveState,
    GatewayError,
    Supervision,
)
from console.client.results import TeleopAnswer, TeleopState
from console.presentation.json_form import json_form
from console.steering import Speeds

_TICK_S: Final = 0.02
_LAST_CALLS_S: Final = 2.0
"""For calls that are on their way when driving ends."""
_DRAW_EVERY: Final = 10
"""Ticks between two lines on the terminal."""


TakeOverOption = Annotated[
    bool,
    typer.Option("--take-over", help="Take the lease from another driver, who has not held for 2 s."),
]
EnableOption = Annotated[bool, typer.Option("--enable", help="Enable driving first, for all.")]
DisableOption = Annotated[
    bool,
    typer.Option("--disable", help="Disable driving, for all, and end; a session that drives ends, too."),
]
SpeedOption = Annotated[
    float | None,
    typer.Option("--speed", min=0.01, max=5, metavar="M/S", help="Speed.", show_default="what is permitted"),
]
TurnOption = Annotated[
    float | None,
    typer.Option(
        "--turn", min=0.01, max=10, metavar="RAD/S", help="Turning rate.", show_default="what is permitted"
    ),
]


InputOption = Annotated[
    Input,
    typer.Option(
        "--input",
        help="What steers; auto: the keyboard, and a gamepad where one can be read.",
        show_default=True,
    ),
]


@with_session
def drive(
    session: Session,
    *,
    take_over: TakeOverOption = False,
    enable: EnableOption = False,
    disable: DisableOption = False,
    speed: SpeedOption = None,
    turn: TurnOption = None,
    by: InputOption = Input.AUTO,
) -> None:
    """Drive the robot by keyboard or gamepad, with your own eyes on it, where the robot permits that.

    w s or the arrows: forward, back. a d or the arrows: turn. q e: sideways. Space stops the robot until r
    resets that. x, Esc or Ctrl-C: end. The robot moves while a key is down; where the terminal does not
    report releases, for 0.3 s after each press. Gamepad: hold a shoulder button and steer, left stick forward
    and sideways, right stick turn; B stops the robot.
    """
    if disable:
        if take_over or enable or speed or turn or by is not Input.AUTO:
            raise UserError(
                "--disable drives nothing, and has no other option of drive beside it",
                "Type: robotctl drive --disable",
                exit_code=ExitCode.USAGE,
            )
        with session.connect() as gateway:
            answer = gateway.set_driving_enabled(False)
        _require_accepted(answer)
        session.show_answer(answer)
        return
    with controls(by) as steered_by:
        asyncio.run(_drive(session, steered_by, take_over=take_over, enable=enable, speeds=(speed, turn)))


async def _drive(
    session: Session,
    steered_by: Controls,
    *,
    take_over: bool,
    enable: bool,
    speeds: tuple[float | None, float | None],
) -> None:
    options = DriveOptions(
        take_over=take_over,
        supervision=Supervision.LINE_OF_SIGHT,
        input_device="keyboard",
    )
    async with session.connect_async() as client:
        if (await client.status()).teleop.state is TeleopState.UNKNOWN:
            raise UserError("this robot is not set up for driving", "See docs/driving.md")
        if not has_keyboard():
            raise UserError("driving needs a terminal to type in", "Type the command in a terminal")
        if enable:
            _require_accepted(await client.set_driving_enabled(True))
        async with client.drive(options) as driving:
            await _Cockpit(session, client, driving, speeds, steered_by).run()


def _require_accepted(answer: TeleopAnswer) -> None:
    if not answer.accepted:
        raise UserError(f"the robot refused: {answer.message}")


class _Cockpit:
    """The keyboard, the gamepad, the session and the line on the terminal."""

    def __init__(
        self,
        session: Session,
        client: AsyncGatewayClient,
        driving: DriveSession,
        speeds: tuple[float | None, float | None],
        controls: Controls,
    ) -> None:
        limits = driving.limits
        assert limits is not None, "it is open"  # noqa: S101  # the session has them from its opening
        self._session = session
        self._client = client
        self._driving = driving
        self._controls = controls
        most = Speeds(*limits.permitted(Supervision.LINE_OF_SIGHT))
        speed_mps, turn_rad_s = speeds
        self._speeds = Speeds(speed_mps or most.vx_mps, speed_mps or most.vy_mps, turn_rad_s or most.wz_rad_s)
        self._shown: object = None
        self._shown_stop = 0
        """Number of the stop that is shown, which a reset is for; 0 without one."""
        self._note = ""
        self._begun = False
        """Whether the robot was ready once: a key that is down before would be a hold without a beginning."""
        self._calls: set[asyncio.Task[None]] = set()
        self._failed_stop = ""
        """Why a stop has failed after the end of driving, when no line shows it any more; empty: none has."""
        self._ending = False

    async def run(self) -> None:
        """Drives until a key ends it.

        Raises:
            GatewayError: The session has ended.
            UserError: The robot has not confirmed the last stop.
        """
        keyboard = Keyboard()
        keyboard.take()
        try:
            # To the end of the calls: a second signal is not to end a stop that is on its way.
            with handled(dict.fromkeys(ENDING, self._end)):
                try:
                    async with drive_terminal.reporting_keys(keyboard, self._take_meanwhile) as hands:
                        self._warn(hands)
                        with drive_terminal.reading(keyboard, lambda typed: self._take(typed, hands)):
                            await self._drive(hands)
                finally:
                    await self._finish_calls()
        finally:
            keyboard.give_back()
            if not self._session.as_json:
                print(file=self._session.out.file)
        if self._failed_stop:
            raise UserError(f"the stop is not confirmed: {self._failed_stop}")

    async def _drive(self, hands: Hands) -> None:
        """Drives until the end; then releases first: a terminal that is frozen may hold up all else."""
        ticks = 0
        try:
            while not self._ending:
                self._driving.check()
                if self._controls.take_stop():
                    hands.release()
                    self._call(self._stop("by the driver's gamepad"))
                if request := hands.ask(time.monotonic()):
                    drive_terminal.ask(request)
                self._take("", hands)
                if ticks % _DRAW_EVERY == 0:
                    self._show(hands)
                ticks += 1
                await asyncio.sleep(_TICK_S)
        finally:
            self._driving.release()

    def _end(self) -> None:
        self._ending = True

    def _take(self, typed: str | None, hands: Hands) -> None:
        if typed is None:
            hands.release()
            self._ending = True
            return
        for action in hands.take(typed, time.monotonic()):
            match action:
                case Action.QUIT:
                    self._ending = True
                case Action.STOP:
                    hands.release()
                    self._call(self._stop("by the driver's keyboard"))
                case Action.RESET if self._shown_stop:
                    self._call(self._reset(self._shown_stop))
                case Action.RELEASE:
                    self._controls.release()
        self._hold(hands)

    def _take_meanwhile(self, actions: list[Action]) -> None:
        """Takes what is typed before driving and after it: a stop and the end count at any time."""
        if Action.STOP in actions:
            self._call(self._stop("by the driver's keyboard"))
        if Action.QUIT in actions:
            self._ending = True

    def _hold(self, hands: Hands) -> None:
        self._begun = self._begun or self._driving.is_ready
        steering, device = self._controls.steering(hands)
        if steering is None or not self._begun:
            self._driving.release()
        else:
            self._driving.hold(*self._speeds.velocity(steering), input_device=device)

    def _call(self, call: Any) -> None:
        task = asyncio.create_task(call)
        self._calls.add(task)
        task.add_done_callback(self._calls.discard)

    async def _finish_calls(self) -> None:
        """Gives calls that are on their way a moment: a stop may have been the last of them."""
        if self._calls:
            await asyncio.wait(self._calls, timeout=_LAST_CALLS_S)
        await cancel(self._calls)

    async def _stop(self, reason: str) -> None:
        try:
            self._note = (await self._client.stop_robot(reason)).message
        except GatewayError as error:
            self._note = str(error)
            if self._ending:
                self._failed_stop = self._note
        except asyncio.CancelledError:
            self._failed_stop = f"no answer within {_LAST_CALLS_S:g} s"
            raise

    async def _reset(self, stop_id: int) -> None:
        try:
            self._note = (await self._client.reset_stop(stop_id)).message
        except GatewayError as error:
            self._note = str(error)

    def _warn(self, hands: Hands) -> None:
        """Says above the line, which has no room for it, what holds as long as the robot is driven."""
        if not self._session.as_json and (warning := self._controls.warning(hands)):
            print(warning, file=self._session.out.file, flush=True)

    def _show(self, hands: Hands) -> None:
        state = self._driving.state
        if state is None:
            return
        self._shown_stop = state.stop.stop_id if state.stop else 0
        if self._session.as_json:
            key = state.phase, state.inhibits, state.stop and state.stop.stop_id
            if key != self._shown:
                self._shown = key
                print_json(self._session.out, json_form(state), on_one_line=True)
            return
        line = self._driving.reasons()
        if self._begun:
            note = self._controls.problem(hands) or self._note or self._controls.advice()
            line = _line(state, self._driving, note)
        if line != self._shown:
            self._shown = line
            width = self._session.out.width - 1
            print(f"\r\x1b[2K{line[:width]}", end="", file=self._session.out.file, flush=True)


def _line(state: DriveState, driving: DriveSession, note: str) -> str:
    speeds = f"{state.vx_mps:+.2f} {state.vy_mps:+.2f} m/s {state.wz_rad_s:+.2f} rad/s"
    moves = state.phase in {DrivePhase.ARMED, DrivePhase.DRIVING, DrivePhase.STOPPING} and not state.inhibits
    words = note if moves else driving.reasons()
    return f"{state.phase.value}  {speeds}  {words}"
