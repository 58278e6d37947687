"""The behaviour that operators' tools in the field rely on, over raw stubs: the real gateway's, the double's.

What a robot's health is made of needs a robot: tests/integration/gateway/ros has it.
"""

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import grpc
import pytest

from omniseer.gateway.v1 import preview_pb2
from omniseer.gateway.v1 import states_pb2 as states
from tests.support.eventually import eventually
from tests.support.operator_grounds import Ground, double_ground, real_ground
from tests.support.running_gateway import Operator

KEEP = preview_pb2.PREVIEW_PROFILE_UNSPECIFIED
LOW_BW = preview_pb2.PREVIEW_PROFILE_LOW_BW
BALANCED = preview_pb2.PREVIEW_PROFILE_BALANCED
HIGH_QUALITY = preview_pb2.PREVIEW_PROFILE_HIGH_QUALITY

# A client asks every 100 ms or so; no answer may come near to what a round trip to a dead service costs.
FROM_MEMORY_S = 1.0


@pytest.fixture(params=[pytest.param(real_ground, id="real", marks=pytest.mark.gst), double_ground])
async def ground(request: pytest.FixtureRequest, tmp_path: Path) -> AsyncIterator[Ground]:
    async with request.param(tmp_path) as ground:
        yield ground


@pytest.fixture
async def operator(ground: Ground) -> Operator:
    """When gateway and preview service have met: what they make of each other is then known."""
    await eventually(ground.operator.status, lambda it: it.preview.service_reachable, "they have met")
    return ground.operator


async def running(operator: Operator, profile: int = KEEP) -> Any:
    """Turns the preview on and waits until frames leave; the preview as it then is."""
    answer = await operator.switch(True, profile)
    assert answer.accepted
    return await preview_in(operator, states.PREVIEW_RUNNING)


async def preview_in(operator: Operator, state: states.PreviewState.ValueType) -> Any:
    """The preview, when it has come to this state."""
    status = await eventually(
        operator.status, lambda it: it.preview.state == state, states.PreviewState.Name(state)
    )
    return status.preview


# --- which profile ---


async def test_the_first_enable_without_a_profile_is_balanced(operator: Operator) -> None:
    before = (await operator.status()).preview
    assert (before.state, before.profile) == (states.PREVIEW_DISABLED, KEEP), "none was ever chosen"
    assert (await running(operator)).profile == BALANCED


async def test_an_enable_without_a_profile_keeps_the_running_one(operator: Operator) -> None:
    await running(operator, LOW_BW)
    assert (await running(operator)).profile == LOW_BW


async def test_the_profile_is_kept_while_the_preview_is_off(operator: Operator) -> None:
    await running(operator, LOW_BW)
    answer = await operator.switch(False)
    assert answer.preview.profile == LOW_BW
    assert (await preview_in(operator, states.PREVIEW_DISABLED)).profile == LOW_BW
    assert (await running(operator)).profile == LOW_BW


async def test_the_profile_of_a_disable_is_ignored(operator: Operator) -> None:
    await running(operator, LOW_BW)
    answer = await operator.switch(False, HIGH_QUALITY)
    assert answer.accepted
    assert (await preview_in(operator, states.PREVIEW_DISABLED)).profile == LOW_BW


@pytest.mark.parametrize(
    ("profile", "fps", "bitrate_kbps"), [(LOW_BW, 15, 1000), (BALANCED, 30, 2500), (HIGH_QUALITY, 60, 4500)]
)
async def test_what_a_profile_is(operator: Operator, profile: int, fps: int, bitrate_kbps: int) -> None:
    preview = await running(operator, profile)
    assert (preview.video.width_px, preview.video.height_px, preview.video.fps) == (1280, 720, fps)
    assert preview.target_bitrate_kbps == bitrate_kbps


async def test_another_profile_is_taken_over_without_a_new_start(ground: Ground, operator: Operator) -> None:
    await running(operator, LOW_BW)
    async with ground.undisturbed():
        preview = await running(operator, BALANCED)
        assert preview.profile == BALANCED
    assert preview.counters.starts == 1


# --- what makes no sense ---


@pytest.mark.parametrize("number", [4, 99, -1])
@pytest.mark.parametrize("is_running", [False, True])
async def test_a_profile_outside_the_contract_changes_nothing(
    operator: Operator, number: int, is_running: bool
) -> None:
    if is_running:
        await running(operator, LOW_BW)
    before = (await operator.status()).preview
    with pytest.raises(grpc.aio.AioRpcError) as seen:
        await operator.switch(True, number)
    assert seen.value.code() is grpc.StatusCode.INVALID_ARGUMENT
    assert str(number) in (seen.value.details() or "")
    after = (await operator.status()).preview
    assert (after.state, after.profile) == (before.state, before.profile)
    assert after.counters == before.counters


async def test_a_disable_with_a_profile_outside_the_contract_is_a_disable(operator: Operator) -> None:
    await running(operator, LOW_BW)
    answer = await operator.switch(False, 99)
    assert answer.accepted
    assert (await preview_in(operator, states.PREVIEW_DISABLED)).profile == LOW_BW


# --- asked again ---


@pytest.mark.parametrize("again", [KEEP, BALANCED])
async def test_what_runs_already_is_not_touched(ground: Ground, operator: Operator, again: int) -> None:
    before = await running(operator, BALANCED)
    async with ground.undisturbed():
        answer = await operator.switch(True, again)
        assert answer.accepted
        assert "already running" in answer.message
        assert (answer.preview.state, answer.preview.profile) == (states.PREVIEW_RUNNING, BALANCED)
    after = (await operator.status()).preview
    assert after.counters == before.counters
    assert after.endpoint.uri == before.endpoint.uri


async def test_turning_off_can_be_asked_for_again_and_again(operator: Operator) -> None:
    for _ in range(2):
        assert (await operator.switch(False)).accepted
        await preview_in(operator, states.PREVIEW_DISABLED)
    await running(operator)
    for _ in range(2):
        assert (await operator.switch(False)).accepted
        preview = await preview_in(operator, states.PREVIEW_DISABLED)
        assert preview.last_error == ""


async def test_on_and_off_and_on_again_is_a_second_start(operator: Operator) -> None:
    assert (await running(operator)).counters.starts == 1
    await operator.switch(False)
    await preview_in(operator, states.PREVIEW_DISABLED)
    assert (await running(operator)).counters.starts == 2


# --- what fails ---


async def test_a_pipeline_that_fails_is_an_answer(ground: Ground, operator: Operator) -> None:
    with ground.nothing_starts():
        answer = await operator.switch(True, LOW_BW)
        assert answer.accepted
        preview = await preview_in(operator, states.PREVIEW_FAULTED)
        assert preview.last_error
        assert preview.counters.faults >= 1
        assert preview.last_error in answer.message, "the message says what the operator is to do"
        assert preview.profile == LOW_BW
    # A new request is a new attempt at once.
    assert (await running(operator)).last_error == ""


async def test_a_fault_ends_with_a_disable_and_its_reason_can_still_be_read(
    ground: Ground, operator: Operator
) -> None:
    with ground.nothing_starts():
        await operator.switch(True)
        fault = (await preview_in(operator, states.PREVIEW_FAULTED)).last_error
        assert (await operator.switch(False)).accepted
        assert (await preview_in(operator, states.PREVIEW_DISABLED)).last_error == fault
    assert (await running(operator)).last_error == ""
    await operator.switch(False)
    assert (await preview_in(operator, states.PREVIEW_DISABLED)).last_error == ""


async def test_a_faulted_preview_is_no_fault_of_the_robots(ground: Ground, operator: Operator) -> None:
    with ground.nothing_starts():
        await operator.switch(True)
        await preview_in(operator, states.PREVIEW_FAULTED)
        assert (await operator.status()).health.ready


# --- answered from memory ---


@pytest.mark.parametrize(
    ("wanted", "state"), [(True, states.PREVIEW_FAULTED), (False, states.PREVIEW_DISABLED)]
)
async def test_a_dead_preview_service_is_a_status(
    ground: Ground, operator: Operator, wanted: bool, state: int
) -> None:
    if wanted:
        await running(operator)
    ground.kill_preview()
    status = await eventually(operator.status, lambda it: not it.preview.service_reachable, "it is gone")
    assert status.preview.state == state
    assert ("unreachable" in status.preview.last_error) is wanted
    assert status.health.ready
    assert (status.health.state, status.health.summary) == (states.ROBOT_HEALTH_OK, "robot healthy")
    await looks_in_time(operator)
    if wanted:
        answer = await operator.switch(False)
        assert answer.accepted
        assert answer.preview.state == states.PREVIEW_DISABLED


async def test_a_hanging_preview_service_delays_no_look(ground: Ground, operator: Operator) -> None:
    await running(operator, LOW_BW)
    ground.hang_preview()
    # A change waits for the preview service; a status does not.
    switching = asyncio.create_task(operator.switch(False))
    await looks_in_time(operator)
    switching.cancel()


async def looks_in_time(operator: Operator) -> None:
    for _ in range(50):
        async with asyncio.timeout(FROM_MEMORY_S):
            await operator.status()
        async with asyncio.timeout(FROM_MEMORY_S):
            await operator.overlay()
