"""One instant of everything: the newest values, their freshness and the verdict that follows."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final

from gateway.status.access import UNGUARDED, AccessView
from gateway.status.board import Board, SourceKind
from gateway.status.command import Command, effective_command
from gateway.status.events import OperatorEvent
from gateway.status.faults.fault import Fault
from gateway.status.freshness import Freshness, Sample, sample
from gateway.status.health import Health, assess
from gateway.status.preview import Measurement, PreviewView
from gateway.status.runtime import UNKNOWN, Runtime
from gateway.status.sources import SourceView, detail, state_of, words_for
from gateway.status.values import (
    Battery,
    CommandSource,
    Compute,
    Detections,
    Diagnostics,
    Mode,
    Network,
    Odometry,
    Vision,
)

MEASUREMENT_STALE_AFTER_MS: Final = 2000


@dataclass(frozen=True, slots=True)
class Identity:
    """Which gateway speaks, and whether anybody on the network may listen in."""

    name: str
    version: str
    insecure: bool


@dataclass(frozen=True, slots=True)
class SourceRule:
    """What is expected of one source."""

    stale_after_ms: int
    required: bool


@dataclass(frozen=True, slots=True)
class Rules:
    """What is expected of everything. A kind that is not in `sources` is not configured."""

    sources: Mapping[SourceKind, SourceRule]
    """All but the mux inputs."""
    platform_stale_after_ms: int
    mux_inputs: Mapping[CommandSource, SourceRule] = field(default_factory=dict)

    def stale_after_ms(self, kind: SourceKind) -> int:
        """The limit of a source; 0 for one that is not configured, and so never has a value."""
        rule = self.sources.get(kind)
        return rule.stale_after_ms if rule else 0

    def if_required(self, kind: SourceKind, freshness: Freshness) -> Freshness | None:
        """The freshness where the robot's health depends on it, else None."""
        rule = self.sources.get(kind)
        return freshness if rule and rule.required else None


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Everything at `at_s`."""

    at_s: float
    identity: Identity
    gateway: Runtime
    health: Health
    odometry: Sample[Odometry]
    vision: Sample[Vision]
    detections: Sample[Detections]
    battery: Sample[Battery]
    diagnostics: Sample[Diagnostics]
    mode: Sample[Mode]
    command: Sample[Command]
    compute: Sample[Compute]
    network: Sample[Network]
    onboard_battery: Sample[Battery]
    preview: PreviewView
    preview_measured: Sample[Measurement]
    sources: tuple[SourceView, ...]
    events: tuple[OperatorEvent, ...]
    faults: tuple[Fault, ...]
    access: AccessView = UNGUARDED


def take(
    *,
    identity: Identity,
    rules: Rules,
    board: Board,
    preview: PreviewView,
    events: tuple[OperatorEvent, ...],
    now_s: float,
    faults: tuple[Fault, ...] = (),
    gateway: Runtime = UNKNOWN,
    access: AccessView = UNGUARDED,
) -> Snapshot:
    """What is true at `now_s`, from the newest values alone."""
    odometry = sample(board.odometry, rules.stale_after_ms(SourceKind.ODOMETRY), now_s)
    vision = sample(board.vision, rules.stale_after_ms(SourceKind.VISION), now_s)
    return Snapshot(
        at_s=now_s,
        identity=identity,
        gateway=gateway,
        health=assess(
            rules.if_required(SourceKind.ODOMETRY, odometry.freshness),
            rules.if_required(SourceKind.VISION, vision.freshness),
        ),
        odometry=odometry,
        vision=vision,
        detections=sample(board.detections, rules.stale_after_ms(SourceKind.DETECTIONS), now_s),
        battery=sample(board.battery, rules.stale_after_ms(SourceKind.BATTERY), now_s),
        diagnostics=sample(board.diagnostics, rules.stale_after_ms(SourceKind.DIAGNOSTICS), now_s),
        mode=sample(board.mode, rules.stale_after_ms(SourceKind.MODE), now_s),
        command=effective_command(
            board.effective_command,
            board.mux_inputs,
            rules.stale_after_ms(SourceKind.EFFECTIVE_COMMAND),
            now_s,
        ),
        compute=sample(board.compute, rules.platform_stale_after_ms, now_s),
        network=sample(board.network, rules.platform_stale_after_ms, now_s),
        onboard_battery=sample(board.onboard_battery, rules.platform_stale_after_ms, now_s),
        preview=preview,
        preview_measured=sample(preview.measured, MEASUREMENT_STALE_AFTER_MS, now_s),
        sources=tuple(_sources(rules, board, now_s)),
        events=events,
        faults=faults,
        access=access,
    )


def _sources(rules: Rules, board: Board, now_s: float) -> Iterator[SourceView]:
    for kind, rule in rules.sources.items():
        if kind is not SourceKind.MUX_INPUT:
            seen = sample(getattr(board, kind.value), rule.stale_after_ms, now_s).freshness
            yield _source(kind, kind.value, rule, seen, board)
    for giver, rule in rules.mux_inputs.items():
        seen = sample(board.mux_inputs.get(giver), rule.stale_after_ms, now_s).freshness
        yield _source(SourceKind.MUX_INPUT, f"{SourceKind.MUX_INPUT.value}.{giver.value}", rule, seen, board)


def _source(kind: SourceKind, name: str, rule: SourceRule, seen: Freshness, board: Board) -> SourceView:
    presence = board.presence.get(name)
    state = state_of(seen, presence, unusable=name in board.unusable)
    words = words_for(name)
    return SourceView(kind, name, words, state, seen, rule.required, detail(state, words, presence))
