"""The mapping is total: every domain value has its message, every field is filled."""

from typing import Any

import pytest

from common.errors import InvalidRequestError
from omniseer.preview.v1 import preview_service_pb2 as pb
from preview.encoders.catalogue import CATALOGUE
from preview.encoders.probe import Verdict
from preview.rpc import mapping
from preview.state.cameras import Camera, CameraState
from preview.state.lifecycle import Counters, Reason, State
from preview.state.values import ActualState, Codec, EncoderChoice, Measurement, Profile, StreamState, Target

FULL = ActualState(
    instance_id="abc",
    applied_revision=7,
    state=State.RUNNING,
    profile=Profile.HIGH_QUALITY,
    last_error="something",
    counters=Counters(starts=1, restarts=2, faults=3, fallbacks=4, viewers_refused=5),
    address="10.0.0.5",
    port=7100,
    latency_ms=125,
    capture_offset_ns=-36,
    stream=StreamState(Target(1280, 720, 60, 4500, 800), 3000, "because", Codec.H265, encrypted=True),
    encoder=EncoderChoice("va-h265", hardware=True, wanted="mpp-h265", fallback_reason="why"),
    measurement=Measurement(59.5, 4400.0, 21, 12, 30.5, 1.5),
    pipeline_state=State.RUNNING,
    reasons=(Reason.VIEWERS, Reason.RECORDING),
    wanted_camera="rear",
    cameras=(
        Camera("rear", CameraState.FAILED, "unplugged", "front"),
        Camera("front", CameraState.LIVE),
    ),
)


@pytest.mark.parametrize(
    ("table", "ours", "theirs"),
    [
        (mapping.STATES, State, pb.LifecycleState),
        (mapping.PROFILES, Profile, pb.Profile),
        (mapping.CODECS, Codec, pb.Codec),
        (mapping.REASONS, Reason, pb.Reason),
        (mapping.CAMERA_STATES, CameraState, pb.CameraState),
    ],
)
def test_every_enum_is_covered_on_both_sides(table: Any, ours: Any, theirs: Any) -> None:
    assert set(table) == set(ours)
    assert sorted(table.values()) == sorted(number for number in theirs.values() if number)


def unset_fields(message: object, prefix: str = "") -> list[str]:
    unset = []
    present = {field.name: value for field, value in message.ListFields()}  # type: ignore[attr-defined]
    for field in message.DESCRIPTOR.fields:  # type: ignore[attr-defined]
        if field.name not in present:
            unset.append(prefix + field.name)
        elif field.is_repeated and field.message_type:
            unset += unset_fields(present[field.name][0], f"{prefix}{field.name}.")
        elif field.message_type:
            unset += unset_fields(present[field.name], f"{prefix}{field.name}.")
    return unset


def test_a_full_status_fills_every_field() -> None:
    assert unset_fields(mapping.actual_state(FULL)) == []


def test_every_value_arrives_at_its_place() -> None:
    assert mapping.actual_state(FULL) == pb.ActualState(
        instance_id="abc",
        applied_revision=7,
        state=pb.LIFECYCLE_STATE_RUNNING,
        profile=pb.PROFILE_HIGH_QUALITY,
        last_error="something",
        counters=pb.Counters(starts=1, restarts=2, faults=3, fallbacks=4, viewers_refused=5),
        listener=pb.Listener(port=7100, latency_ms=125, address="10.0.0.5", capture_offset_ns=-36),
        stream=pb.Stream(
            width_px=1280,
            height_px=720,
            fps=60,
            target_bitrate_kbps=3000,
            codec=pb.CODEC_H265,
            encrypted=True,
            bitrate_reason="because",
        ),
        encoder=pb.Encoder(name="va-h265", hardware=True, wanted="mpp-h265", fallback_reason="why"),
        measurement=pb.Measurement(
            fps=59.5,
            bitrate_kbps=4400,
            viewer_count=21,
            last_frame_age_ms=12,
            worst_rtt_ms=30.5,
            worst_loss_percent=1.5,
        ),
        pipeline_state=pb.LIFECYCLE_STATE_RUNNING,
        reasons=[pb.REASON_VIEWERS, pb.REASON_RECORDING],
        wanted_camera="rear",
        cameras=[
            pb.Camera(name="rear", state=pb.CAMERA_STATE_FAILED, error="unplugged", fallback="front"),
            pb.Camera(name="front", state=pb.CAMERA_STATE_LIVE),
        ],
    )


def test_an_empty_status_leaves_out_what_is_not_there() -> None:
    empty = ActualState("abc", 0, State.DISABLED, Profile.BALANCED, "", Counters(), "::", 7100, 125, -36)
    actual = mapping.actual_state(empty)
    assert not any(actual.HasField(name) for name in ("stream", "encoder", "measurement"))


def test_a_candidate_fills_every_field() -> None:
    candidate = mapping.candidate(CATALOGUE["mpp-h265"], Verdict(True, True, "reason", 12.0))
    assert unset_fields(candidate) == []
    assert candidate == pb.EncoderCandidate(
        name="mpp-h265",
        family="mpp",
        element="mpph265enc",
        codec=pb.CODEC_H265,
        hardware=True,
        present=True,
        proven=True,
        reason="reason",
        first_byte_ms=12,
    )
    untried = mapping.candidate(CATALOGUE["x264"], Verdict(True, False))
    assert (untried.present, untried.proven, untried.HasField("first_byte_ms")) == (True, False, False)


def test_a_desired_state_and_its_passphrase() -> None:
    desired = pb.DesiredState(revision=3, enabled=True, profile=pb.PROFILE_LOW_BW, passphrase="0123456789")
    assert mapping.desired_state(desired).camera == ""
    desired.camera = "rear"
    mapped = mapping.desired_state(desired)
    assert mapped.camera == "rear"
    assert (mapped.revision, mapped.enabled, mapped.profile) == (3, True, Profile.LOW_BW)
    assert mapped.passphrase == "0123456789"
    assert "0123456789" not in repr(mapped)


@pytest.mark.parametrize("passphrase", ["short", "x" * 80, "ä" * 40])
def test_a_passphrase_that_srt_does_not_take_is_refused_without_repeating_it(passphrase: str) -> None:
    desired = pb.DesiredState(enabled=True, profile=pb.PROFILE_LOW_BW, passphrase=passphrase)
    with pytest.raises(InvalidRequestError) as refusal:
        mapping.desired_state(desired)
    assert passphrase not in str(refusal.value)


def test_an_unknown_profile_is_refused_only_when_enabled() -> None:
    with pytest.raises(InvalidRequestError, match="known are low-bw, balanced, high-quality"):
        mapping.desired_state(pb.DesiredState(enabled=True, profile=9))  # type: ignore[arg-type]
    assert not mapping.desired_state(pb.DesiredState(enabled=False, profile=9)).enabled  # type: ignore[arg-type]
