"""The real program between real publishers and a real disk; other programs judge what it leaves."""

from contextlib import suppress
from functools import partial
from pathlib import Path

import psutil
import pytest
from rosbags.rosbag2 import Reader

from omniseer.gateway.v1 import recording_pb2 as pb
from tests.support.running_recorder import RecorderProgram, recorder_program
from tests.support.waiting import wait_until

pytestmark = pytest.mark.ros

TOPIC = "/odom"


def numbers(program: RecorderProgram, made: pb.Recording) -> list[int]:
    """The numbers in the messages of a recording."""
    return [each.data for each in program.decoded(made, TOPIC)]


@pytest.mark.usefixtures("ros_domain")
def test_a_recording_over_the_graph_opens_in_other_programs(tmp_path: Path) -> None:
    from std_msgs.msg import Int64  # noqa: PLC0415

    from tests.support.publishing import publishing  # noqa: PLC0415

    with recorder_program(tmp_path) as program, publishing(TOPIC, Int64) as talker:
        started = program.call("StartRecording", pb.StartRecordingRequest(request_id="1", label="drive"))
        wait_until(lambda: talker.heard, "the recorder has subscribed")
        talker.publish(200)
        # What is published is still on its way: a stop does not wait for it.
        wait_until(lambda: program.state.status.messages_written >= 200, "200 messages")
        stopped = program.call("StopRecording", pb.StopRecordingRequest(request_id="2"))
        made = program.recording(started.recording.id)
        assert stopped.recording.state == made.state == pb.RECORDING_STATE_COMPLETE
        assert numbers(program, made) == list(range(1, 201))
        assert made.messages_lost == 0
        folder = program.root / "recordings" / made.id / "data"
        assert program.stop() == 0
    with Reader(folder) as bag:
        assert bag.topics[TOPIC].msgtype == "std_msgs/msg/Int64"
        assert bag.topics[TOPIC].msgcount == 200


@pytest.mark.usefixtures("ros_domain")
def test_killed_while_it_records_it_goes_on_with_the_same_recording(tmp_path: Path) -> None:
    """What is lost by it is measured in test_kill.py."""
    from std_msgs.msg import Int64  # noqa: PLC0415

    from tests.support.publishing import publishing  # noqa: PLC0415

    with recorder_program(tmp_path) as program, publishing(TOPIC, Int64) as talker:
        started = program.call("StartRecording", pb.StartRecordingRequest(request_id="1"))
        recording_id = started.recording.id

        def arrives(before: int) -> bool:
            """Not by the subscriptions: those of the killed one are announced for some seconds still."""
            talker.publish(1)
            return program.state.status.messages_written > before

        wait_until(partial(arrives, 0), "messages arrive")
        program.kill()
        program.start()
        wait_until(lambda: program.state.status.recording_id == recording_id, "it goes on")
        assert program.state.status.uncounted_gaps >= 1, "what the kill has cost is not counted"
        before = program.state.status.messages_written
        wait_until(partial(arrives, before), "messages arrive again", 60)
        program.call("StopRecording", pb.StopRecordingRequest(request_id="2"))
        made = program.recording(recording_id)
        assert made.state == pb.RECORDING_STATE_COMPLETE
        causes = {gap.cause for gap in made.gaps}
        assert pb.RECORDING_GAP_CAUSE_INTERRUPTED in causes
        assert made.uncounted_gaps >= 1
        assert not made.HasField("messages_lost") or made.messages_lost > 0, "never 0"
        found = numbers(program, made)
        assert found == sorted(set(found))
        assert len([file for file in made.files if file.name.endswith(".mcap")]) >= 2


@pytest.mark.usefixtures("ros_domain")
def test_a_second_recorder_on_the_folder_ends_with_one_sentence(tmp_path: Path) -> None:
    with recorder_program(tmp_path) as program:
        other = RecorderProgram(tmp_path / "other", {"root": str(program.root)})
        other.directory.mkdir()
        with pytest.raises(AssertionError, match="another recorder"):
            other.start()
        assert other.process
        assert other.process.wait(5) == 1
        assert other.log.read_text(encoding="utf-8").count("\n") == 1


def priorities(pid: int) -> list[tuple[bool, int, int]]:
    """Of each thread: whether its nice value is lowered, and its I/O class and level."""
    found = []
    for thread in psutil.Process(pid).threads():
        with suppress(psutil.NoSuchProcess):  # One of a pool may end meanwhile.
            of_thread = psutil.Process(thread.id)
            ionice = of_thread.ionice()
            found.append((of_thread.nice() >= 10, int(ionice.ioclass), int(ionice.value)))
    return found


@pytest.mark.usefixtures("ros_domain")
def test_all_its_threads_are_behind_everything_else_on_the_robot(tmp_path: Path) -> None:
    """Those of gRPC, rclpy and the writer, too: each has the priority of the thread that started it."""
    with recorder_program(tmp_path, ring={"preset": "all"}) as program:
        assert program.process
        found = priorities(program.process.pid)
        assert program.stop() == 0
    assert len(found) > 3
    assert set(found) == {(True, int(psutil.IOPRIO_CLASS_BE), 7)}
