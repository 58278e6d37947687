"""The intake on a real graph: real rclpy over Fast DDS."""

import json
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore
from std_msgs.msg import Int32, String

from recorder.intake.intake import intake
from recorder.intake.latched import LatchedCache
from recorder.mcap.rosbag2 import FILE_NAME, metadata
from recorder.mcap.writer import SegmentWriter
from recorder.values import Ended, Loss, Sample
from tests.integration.recorder.conftest import Everything, Taken
from tests.support.helper import first_line, helper
from tests.support.talker import Talker, talking
from tests.support.waiting import wait_until

ROOT = Path(__file__).parents[3]


def subscribed(publisher: Any) -> None:
    wait_until(lambda: publisher.get_subscription_count() > 0, "a subscription")


def test_what_is_published_arrives_with_numbers_and_times(talker: Talker, taken: Taken) -> None:
    publisher = talker.publisher("/odom", Odometry)
    subscribed(publisher)
    for _ in range(50):
        publisher.publish(Odometry())
    wait_until(lambda: len(taken.samples("/odom")) == 50, "50 messages")
    samples = taken.samples("/odom")
    assert [each.sequence for each in samples] == list(range(1, 51))
    assert all(each.publish_time_ns <= each.log_time_ns for each in samples)
    assert [each.monotonic_ns for each in samples] == sorted(each.monotonic_ns for each in samples)
    (channel,) = taken.channels("/odom")
    assert channel.type == "nav_msgs/msg/Odometry"
    assert channel.presets == {"everything"}
    assert not channel.latched
    assert not taken.intake.problems


def test_independent_readers_decode_what_was_taken(talker: Talker, taken: Taken, tmp_path: Path) -> None:
    publisher = talker.publisher("/odom", Odometry)
    subscribed(publisher)
    for number in range(20):
        message = Odometry()
        message.pose.pose.position.x = float(number)
        message.child_frame_id = "base_link"
        publisher.publish(message)
    wait_until(lambda: len(taken.samples("/odom")) == 20, "20 messages")
    writer = SegmentWriter(tmp_path / "000000.mcap.part")
    for sample in taken.samples("/odom"):
        writer.write(sample)
    segment = writer.finish()
    (tmp_path / FILE_NAME).write_text(metadata([segment]))
    with segment.path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        decoded = [message for *_, message in reader.iter_decoded_messages()]
    assert [each.pose.pose.position.x for each in decoded] == list(range(20))
    assert {each.child_frame_id for each in decoded} == {"base_link"}
    store = get_typestore(Stores.ROS2_JAZZY)
    with Reader(tmp_path) as bag:
        values = [store.deserialize_cdr(data, each.msgtype) for each, _, data in bag.messages()]
    assert [each.pose.pose.position.x for each in values] == list(range(20))  # type: ignore[attr-defined]


def test_latched_messages_reach_an_intake_that_comes_late(talker: Talker) -> None:
    latched = {"durability": DurabilityPolicy.TRANSIENT_LOCAL, "depth": 1}
    publisher = talker.publisher("/robot_description", String, **latched)
    publisher.publish(String(data="first"))
    publisher.publish(String(data="second"))
    items: list[Any] = []
    with intake({"everything": Everything()}, items.extend) as running:
        running.want(frozenset({"everything"}))
        wait_until(lambda: items, "the latched message")
    (sample,) = [each for each in items if isinstance(each, Sample)]
    assert sample.channel.latched
    assert b"second" in sample.data


def test_static_transforms_of_two_publishers_are_kept_in_any_order(talker: Talker) -> None:
    """The defect: what the one had sent was in no later file if the other's message had a higher number."""
    latched = QoSProfile(durability=DurabilityPolicy.TRANSIENT_LOCAL, depth=1)
    base, arm = (talker.node.create_publisher(String, "/tf_static", latched) for _ in range(2))
    base.publish(String(data="base"))
    for number in range(3):
        arm.publish(String(data=f"arm {number}"))
    items: list[Any] = []
    with intake({"everything": Everything()}, items.extend) as running:
        wait_until(lambda: running._node.count_publishers("/tf_static") == 2, "both publishers")
        running.want(frozenset({"everything"}))
        wait_until(
            lambda: len([each for each in list(items) if isinstance(each, Sample)]) == 2, "both messages"
        )
    samples = [each for each in items if isinstance(each, Sample)]
    assert {each.publishers for each in samples} == {2}
    for order in (samples, samples[::-1]):
        cache = LatchedCache()
        for each in order:
            cache.take(each)
        assert list(cache.samples()) == order


def test_a_latched_topic_that_is_no_longer_taken_has_ended(talker: Talker, taken: Taken) -> None:
    latched = {"durability": DurabilityPolicy.TRANSIENT_LOCAL, "depth": 1}
    talker.publisher("/robot_description", String, **latched).publish(String(data="first"))
    wait_until(lambda: taken.samples("/robot_description"), "the latched message")
    taken.intake.want(frozenset({"nothing"}))
    wait_until(lambda: any(isinstance(each, Ended) for each in list(taken.items)), "the end")
    (ended,) = [each for each in taken.items if isinstance(each, Ended)]
    assert ended.channel is taken.samples("/robot_description")[0].channel


def kept_for_later_segments(taken: Taken) -> list[bytes]:
    """What each later segment of a recording begins with."""
    cache = LatchedCache()
    for each in list(taken.items):
        if isinstance(each, Sample) and each.channel.latched:
            cache.take(each)
    return [each.data for each in cache.samples()]


def caught_up(taken: Taken) -> None:
    """Returns when all losses so far are reported."""
    ticket = taken.intake.catch_up()
    wait_until(lambda: taken.intake.caught_up >= ticket, "the intake has caught up")


@pytest.mark.parametrize("seen", [True, False], ids=["taken before", "sent before"])
def test_a_map_is_in_later_segments_once_no_volatile_publisher_is_beside_it(
    talker: Talker, taken: Taken, seen: bool
) -> None:
    """The defect: the topic counted for ever as what it was when it was examined first."""
    latched = QoSProfile(durability=DurabilityPolicy.TRANSIENT_LOCAL, depth=1)
    with talking("editor") as editor:
        volatile = editor.publisher("/map", String)
        subscribed(volatile)
        for _ in range(3):
            volatile.publish(String(data="edited"))
        wait_until(lambda: len(taken.samples("/map")) == 3, "the volatile messages")
        publisher = talker.node.create_publisher(String, "/map", latched)
        if not seen:
            publisher.publish(String(data="stays"))
        subscribed(publisher)
        if seen:
            publisher.publish(String(data="stays"))
            wait_until(lambda: len(taken.samples("/map")) == 4, "the map, as it is sent")
        caught_up(taken)
        assert not any(each.latched for each in taken.channels("/map"))
    wait_until(lambda: kept_for_later_segments(taken), "the map, as late subscribers get it")
    (kept,) = kept_for_later_segments(taken)
    assert b"stays" in kept
    first, second = taken.channels("/map")
    assert (first.topic, first.type, first.schema) == (second.topic, second.type, second.schema)
    assert "transient_local" in second.offered_qos
    caught_up(taken)
    assert not [each for each in taken.items if isinstance(each, Loss)], "what comes again was not lost"


def test_a_map_whose_publishers_could_not_be_examined_at_first_is_in_later_segments(
    talker: Talker, taken: Taken, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As while a peer has a name that is not UTF-8."""
    node = taken.intake._node  # its graph is what can't be examined
    with monkeypatch.context() as patch:

        def unreadable(_topic: str) -> Any:
            raise UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid start byte")

        patch.setattr(node, "get_publishers_info_by_topic", unreadable)
        latched = QoSProfile(durability=DurabilityPolicy.TRANSIENT_LOCAL, depth=5)
        taken.intake.want(frozenset({"nothing"}))
        caught_up(taken)
        publisher = talker.node.create_publisher(String, "/map", latched)
        publisher.publish(String(data="before"))
        # Not sooner: with a subscription, the message would be no more of the past.
        taken.intake.want(frozenset({"everything"}))
        subscribed(publisher)
        assert not taken.samples("/map"), "a volatile subscription gets nothing of the past"
        for number in range(3):
            publisher.publish(String(data=f"during {number}"))
        wait_until(lambda: len(taken.samples("/map")) == 3, "the maps, as they are sent")
    wait_until(lambda: kept_for_later_segments(taken), "the map, as late subscribers get it")
    publisher.publish(String(data="after"))
    wait_until(lambda: b"after" in taken.samples("/map")[-1].data, "the next map")
    (kept,) = kept_for_later_segments(taken)
    assert b"after" in kept
    caught_up(taken)
    assert not [each for each in taken.items if isinstance(each, Loss)], "what comes again was not lost"


def test_qos_follows_publishers_that_join_later(talker: Talker, taken: Taken) -> None:
    """A reliable subscription would never hear the best-effort publisher."""
    reliable = talker.publisher("/chatter", String)
    subscribed(reliable)
    best_effort = QoSProfile(reliability=ReliabilityPolicy.BEST_EFFORT, depth=100)
    sensor = talker.node.create_publisher(String, "/chatter", best_effort)
    subscribed(sensor)
    for number in range(200):
        reliable.publish(String(data=f"r{number}"))
        sensor.publish(String(data=f"s{number}"))
        threading.Event().wait(0.01)
    wait_until(lambda: len(taken.samples("/chatter")) == 400, "400 messages, none of them twice")
    assert len({each.data for each in taken.samples("/chatter")}) == 400


def test_a_topic_with_another_type_is_another_channel(talker: Talker, taken: Taken) -> None:
    text = talker.publisher("/value", String)
    subscribed(text)
    text.publish(String(data="one"))
    wait_until(lambda: taken.samples("/value"), "the text")
    talker.fall_silent("/value", String)
    number = talker.publisher("/value", Int32)
    subscribed(number)
    number.publish(Int32(data=2))
    wait_until(lambda: len(taken.samples("/value")) == 2, "the number")
    assert [each.type for each in taken.channels("/value")] == ["std_msgs/msg/String", "std_msgs/msg/Int32"]


def test_a_topic_that_vanishes_is_recorded_again_when_it_is_back(talker: Talker, taken: Taken) -> None:
    """As when the program that publishes it is started again."""
    for number in range(3):
        publisher = talker.publisher("/value", Int32)
        subscribed(publisher)
        publisher.publish(Int32(data=number))
        wait_until(lambda: len(taken.samples("/value")) == number + 1, "one message more")  # noqa: B023  # waited for
        talker.fall_silent("/value", Int32)
    assert len(taken.channels("/value")) == 1
    assert taken.lost("/value") == 0
    assert not taken.intake.problems


def test_of_two_types_at_a_time_one_is_recorded(talker: Talker, taken: Taken) -> None:
    text = talker.publisher("/value", String)
    subscribed(text)
    with talking("second") as second:
        second.publisher("/value", Int32)
        # It is one for as long as both publish.
        problem = wait_until(lambda: taken.intake.problems.get("/value"), "a problem")
        text.publish(String(data="one"))
        wait_until(lambda: taken.samples("/value"), "the text")
    assert "std_msgs/msg/String alone" in problem


def test_a_type_that_is_not_installed_is_a_problem_with_a_remedy(talker: Talker, taken: Taken) -> None:
    # The registry of installed packages is what the other machine has and this one lacks.
    with patch("recorder.intake.schemas.share_directory", lambda _package: None):
        publisher = talker.publisher("/odom", Odometry)
        problem = wait_until(lambda: taken.intake.problems.get("/odom"), "a problem")
        assert "apt install ros-$ROS_DISTRO-nav-msgs" in problem
    subscribed(publisher)
    wait_until(lambda: not taken.intake.problems, "no problem")


def test_only_what_is_wanted_is_subscribed(talker: Talker, taken: Taken) -> None:
    publisher = talker.publisher("/odom", Odometry)
    subscribed(publisher)
    taken.intake.want(frozenset({"nothing"}))
    wait_until(lambda: publisher.get_subscription_count() == 0, "no subscription")
    taken.intake.want(frozenset({"everything"}))
    subscribed(publisher)
    publisher.publish(Odometry())
    wait_until(lambda: taken.samples("/odom"), "a message")


def test_a_peer_whose_name_is_not_text_costs_the_others_nothing(talker: Talker, taken: Taken) -> None:
    with helper("tests.support.undecodable_peer", "/theirs") as peer:
        assert first_line(peer) == "ready\n"
        publisher = talker.publisher("/odom", Odometry)
        subscribed(publisher)
        publisher.publish(Odometry())
        wait_until(lambda: taken.samples("/odom"), "a message")
        wait_until(lambda: taken.samples("/theirs"), "a message of the peer itself")


@pytest.mark.parametrize(
    ("hz", "size", "count"), [(1000, 60, 3000), (5, 8_000_000, 10)], ids=["1 kHz", "8 MB"]
)
def test_taken_and_counted_lost_are_what_was_published(taken: Taken, hz: int, size: int, count: int) -> None:
    received, lost = taken_and_lost(taken, hz, size, count)
    assert received + lost == count
    assert received > 0


def test_what_a_stalled_intake_loses_is_counted(
    ros_domain: int,  # noqa: ARG001  # for its effect
) -> None:
    """The thread is held up for a second in which more comes than the queue holds."""
    items: list[Any] = []
    stalled = threading.Event()

    def put(taken: Any) -> None:
        items.extend(taken)
        if len(items) > 200 and not stalled.is_set():
            stalled.set()
            threading.Event().wait(1.0)

    with intake({"everything": Everything()}, put) as running:
        running.want(frozenset({"everything"}))
        received, lost = taken_and_lost(Taken(running, items), 1000, 60, 3000)
    assert stalled.is_set()
    assert received + lost == 3000
    assert lost > 100


def stall(taken: Taken, publisher: Any, message: Any) -> None:
    """Holds the intake up while more comes than its queue holds; its next pass takes what is left of it."""
    held, goes_on = threading.Event(), threading.Event()
    put = taken.intake._put  # the thread is held where it hands over

    def hold(items: Any) -> None:
        taken.intake._put = put
        held.set()
        goes_on.wait(10)
        put(items)

    taken.intake._put = hold
    publisher.publish(message)
    assert held.wait(10)
    for _ in range(1000):
        publisher.publish(message)
    goes_on.set()


def test_losses_are_reported_once_the_intake_has_caught_up(
    talker: Talker, taken: Taken, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And not only when the graph is examined the next time: a recording has ended by then."""
    publisher = talker.publisher("/value", Int32)
    subscribed(publisher)
    publisher.publish(Int32(data=-1))
    wait_until(lambda: taken.samples("/value"), "a message")
    monkeypatch.setattr("recorder.intake.intake.EXAMINE_EVERY_S", 1000.0)
    ticket = taken.intake.catch_up()
    wait_until(lambda: taken.intake.caught_up >= ticket, "the graph is not examined again by itself")
    stall(taken, publisher, Int32())
    ticket = taken.intake.catch_up()
    wait_until(lambda: taken.intake.caught_up >= ticket, "the intake has caught up")
    assert taken.lost("/value") > 0
    assert len(taken.samples("/value")) + taken.lost("/value") == 1002


def test_a_topic_that_changes_its_type_keeps_the_count_of_its_last_second(
    talker: Talker, taken: Taken, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The graph names the new type before the old one, whose losses have not been counted yet."""
    text = talker.publisher("/value", String)
    subscribed(text)
    text.publish(String(data="first"))
    wait_until(lambda: taken.samples("/value"), "a message")
    monkeypatch.setattr("recorder.intake.intake.EXAMINE_EVERY_S", 1000.0)
    ticket = taken.intake.catch_up()
    wait_until(lambda: taken.intake.caught_up >= ticket, "the graph is not examined again by itself")
    stall(taken, text, String(data="x"))
    text.publish(String(data="last"))
    wait_until(lambda: b"last" in taken.samples("/value")[-1].data, "all that has not been lost")
    talker.fall_silent("/value", String)
    talker.publisher("/value", Int32)

    def published() -> set[str]:
        offers = taken.intake._node.get_publishers_info_by_topic("/value")
        return {each.topic_type for each in offers}

    wait_until(lambda: published() == {"std_msgs/msg/Int32"}, "the other type alone")
    ticket = taken.intake.catch_up()
    wait_until(lambda: taken.intake.caught_up >= ticket, "the intake has caught up")
    assert taken.lost("/value") > 0
    assert len(taken.samples("/value")) + taken.lost("/value") == 1003


def test_how_many_are_lost_is_unknown_while_the_publishers_are(talker: Talker, taken: Taken) -> None:
    with helper("tests.support.undecodable_peer", "/theirs") as peer:
        assert first_line(peer) == "ready\n"
        publisher = talker.publisher("/theirs", Odometry)
        subscribed(publisher)
        wait_until(lambda: taken.samples("/theirs"), "a message of the peer")
        stall(taken, publisher, Odometry())

        def reported() -> list[Loss]:
            losses = [each for each in list(taken.items) if isinstance(each, Loss)]
            return [each for each in losses if each.channel and each.channel.topic == "/theirs"]

        wait_until(reported, "a loss")
        assert {each.messages for each in reported()} == {None}


def test_what_is_lost_is_reported_while_the_topics_cannot_be_listed(
    talker: Talker, taken: Taken, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The defect: all numbers were kept until they could, and what was lost was reported then."""
    publisher = talker.publisher("/value", Int32)
    subscribed(publisher)
    publisher.publish(Int32(data=-1))
    wait_until(lambda: taken.samples("/value"), "a message")

    def fail(*_: object) -> Any:
        raise RuntimeError("no graph")

    monkeypatch.setattr("recorder.intake.intake.selected", fail)
    wait_until(lambda: "no graph" in taken.intake.problems.get("", ""), "the topics can't be listed")
    stall(taken, publisher, Int32())

    def losses() -> list[Loss]:
        return [each for each in list(taken.items) if isinstance(each, Loss)]

    wait_until(losses, "a loss")
    assert {(each.channel and each.channel.topic, each.messages) for each in losses()} == {("/value", None)}


def test_what_is_lost_is_reported_while_a_topic_cannot_be_subscribed_anew(
    talker: Talker, taken: Taken, monkeypatch: pytest.MonkeyPatch
) -> None:
    best_effort = QoSProfile(reliability=ReliabilityPolicy.BEST_EFFORT, depth=100)
    sensor = talker.node.create_publisher(Int32, "/value", best_effort)
    publisher = talker.publisher("/value", Int32)
    for each in (sensor, publisher):
        subscribed(each)
        each.publish(Int32(data=-1))
    wait_until(lambda: len(taken.samples("/value")) == 2, "a message of each")

    def fail(*_: object) -> Any:
        raise RuntimeError("no subscription")

    monkeypatch.setattr("recorder.intake.source.subscribe_raw", fail)
    talker.node.destroy_publisher(sensor)  # A reliable subscription is to take the place of this one.
    wait_until(lambda: "no subscription" in taken.intake.problems.get("/value", ""), "a problem")
    stall(taken, publisher, Int32())
    wait_until(lambda: taken.lost("/value"), "a loss")


def taken_and_lost(taken: Taken, hz: int, size: int, count: int) -> tuple[int, int]:
    """Has another process publish, and returns the numbers when they add up to what it has published."""
    command = [
        sys.executable,
        "-m",
        "tests.support.publisher_program",
        "/data",
        str(hz),
        str(size),
        str(count),
    ]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT
    ) as publisher:
        assert publisher.stdout
        assert publisher.stdin
        assert publisher.stdout.readline() == "first\n"
        # Losses are counted from the first number on that is seen: the queue must not overflow before.
        wait_until(lambda: taken.samples("/data"), "the first message")
        publisher.stdin.write("\n")
        publisher.stdin.flush()
        (published,) = json.loads(publisher.stdout.readline())
        assert published == count
        wait_until(
            lambda: len(taken.samples("/data")) + taken.lost("/data") >= published,
            "taken and lost are what was published",
        )
        publisher.stdin.close()
    return len(taken.samples("/data")), taken.lost("/data")
