"""The preview service's schema and the gateway's dataclasses: every value at its destination."""

import pytest

from gateway.links.preview import wire
from gateway.links.preview.state import PreviewReport, PreviewSpec
from gateway.links.reconciler import Desired
from gateway.links.watch import LinkLostError
from gateway.status.preview import (
    Camera,
    CameraState,
    Codec,
    Counters,
    Encoder,
    Listener,
    Measurement,
    PreviewState,
    Profile,
    Stream,
)
from omniseer.preview.v1 import preview_service_pb2 as pb


def test_every_state_profile_and_codec_has_its_value() -> None:
    assert set(wire.STATES.values()) == set(PreviewState)
    assert {0, *wire.STATES} == set(pb.LifecycleState.values())
    assert set(wire.PROFILES) == set(Profile)
    assert {0, *wire.PROFILES.values()} == set(pb.Profile.values())
    assert set(wire.CODECS.values()) == set(Codec)
    assert {0, *wire.CODECS} == set(pb.Codec.values())


def test_a_full_report() -> None:
    message = pb.ActualState(
        instance_id="process-1",
        applied_revision=7,
        state=pb.LIFECYCLE_STATE_FAULTED,
        profile=pb.PROFILE_HIGH_QUALITY,
        last_error="no camera",
        listener=pb.Listener(port=7100, latency_ms=125, address="10.0.0.5", capture_offset_ns=-36),
        stream=pb.Stream(
            width_px=1280,
            height_px=720,
            fps=30,
            target_bitrate_kbps=2500,
            codec=pb.CODEC_H265,
            encrypted=True,
            bitrate_reason="6 % loss",
        ),
        encoder=pb.Encoder(name="x264", hardware=True, wanted="mpp-h265", fallback_reason="absent"),
        measurement=pb.Measurement(
            fps=29.5,
            bitrate_kbps=2400,
            viewer_count=2,
            last_frame_age_ms=12,
            worst_rtt_ms=0,
            worst_loss_percent=1.5,
        ),
        counters=pb.Counters(starts=1, restarts=2, faults=3, fallbacks=4, viewers_refused=5),
        # A recording is no affair of the preview's operators: the gateway has no use for these.
        pipeline_state=pb.LIFECYCLE_STATE_RUNNING,
        reasons=[pb.REASON_RECORDING],
        wanted_camera="front",
        cameras=[
            pb.Camera(name="front", state=pb.CAMERA_STATE_FAILED, error="unplugged", fallback="rear"),
            pb.Camera(name="rear", state=9),  # type: ignore[arg-type]  # of a newer service
        ],
    )
    assert {field.name for field, _ in message.ListFields()} == set(pb.ActualState.DESCRIPTOR.fields_by_name)
    assert wire.from_wire(message) == PreviewReport(
        instance_id="process-1",
        applied_revision=7,
        state=PreviewState.FAULTED,
        profile=Profile.HIGH_QUALITY,
        last_error="no camera",
        listener=Listener(port=7100, latency_ms=125, address="10.0.0.5", capture_offset_ns=-36),
        stream=Stream(1280, 720, 30.0, 2500, Codec.H265, True, "6 % loss"),
        encoder=Encoder(name="x264", hardware=True, wanted="mpp-h265", fallback_reason="absent"),
        measurement=Measurement(29.5, 2400.0, 2, 12, worst_rtt_ms=0.0, worst_loss_percent=1.5),
        counters=Counters(starts=1, restarts=2, faults=3, fallbacks=4, viewers_refused=5),
        wanted_camera="front",
        cameras=(
            Camera("front", CameraState.FAILED, "unplugged", "rear"),
            Camera("rear", None),
        ),
    )


def test_an_empty_report() -> None:
    assert wire.from_wire(pb.ActualState(state=pb.LIFECYCLE_STATE_DISABLED)) == PreviewReport(
        "", 0, PreviewState.DISABLED, None, "", None, None, None, None, Counters()
    )


def test_without_viewers_there_is_no_worst_one_and_without_an_encoder_no_codec() -> None:
    report = wire.from_wire(
        pb.ActualState(
            state=pb.LIFECYCLE_STATE_STARTING, stream=pb.Stream(), measurement=pb.Measurement(fps=30)
        )
    )
    assert report.measurement == Measurement(30.0, 0.0, 0, 0, None, None)
    assert report.stream == Stream(0, 0, 0.0, 0, None, False, "")


def test_an_unknown_state_breaks_the_link() -> None:
    with pytest.raises(LinkLostError, match="state number 42"):
        wire.from_wire(pb.ActualState(state=42))  # type: ignore[arg-type]  # the point of it


@pytest.mark.parametrize(
    ("spec", "expected"),
    [
        (PreviewSpec(), pb.DesiredState(revision=7)),
        (
            PreviewSpec(True, Profile.LOW_BW, "secret-of-the-session", "rear"),
            pb.DesiredState(
                revision=7,
                enabled=True,
                profile=pb.PROFILE_LOW_BW,
                passphrase="secret-of-the-session",
                camera="rear",
            ),
        ),
    ],
)
def test_a_desired_state(spec: PreviewSpec, expected: pb.DesiredState) -> None:
    assert wire.to_wire(Desired(7, spec, "request-1")).desired == expected
