"""What the tables of docs/benchmarks.md can't show: how they come about, and why a row misses its bar."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

REMARKS: Final[Mapping[tuple[str, ...], str]] = {
    ("ros.flat",): (
        "each message that arrives costs the process some tens of microseconds, in the threads of Fast DDS"
        " and in the one that takes it; only what is done with the newest one is the same at any rate."
    ),
    ("ros.gateway_cpu", "cli.status_ms"): (
        "bars on the value itself, which grows where the processor is slow. On the one that these figures are"
        " of, an empty Python program takes 64 to 67 ms."
    ),
    ("ros.value_latency_ms",): (
        "a value waits up to 50 ms for the sampler (20 Hz). The bar leaves 10 ms for the sampler's pass, the"
        " call and the 2 ms between two calls."
    ),
    ("watch.p99_healthy", "status.p99"): (
        "callers and gateway share the cores of one machine. Where other programs take these, both rows rise"
        " beyond their bars. In `watch.p99_healthy` the clients of the load do so: 100 watchers, and one that"
        " floods, with the priority of the caller that is measured."
    ),
    ("status.tls",): (
        "each call is decrypted, its token checked and its answer encrypted: a call takes"
        " about a third longer than without. The rounds differ by more than that is from the bar."
    ),
    ("export.throughput", "export.status_p99_unlimited"): (
        "the gateway reads each file and computes a CRC-32C of each chunk, where the reference sends what it"
        " has in memory: 1.0 against 0.5 ms of processor time per MiB (decision 0015). Without a limit and"
        " over loopback it takes all that the processors have; `export.status_p99` has the limit that leaves"
        " a status its time."
    ),
    ("siege.p99", "siege.answered"): (
        "all attackers come from new addresses at the beginning of each turn, and until these are blocked, a"
        " second or two later, thousands of their connections and calls are before the operator's. gRPC"
        " cancels calls where its queue is full."
    ),
    ("siege.revocation_s",): (
        "in one of five rounds; the median is 0.3 s. Amid the attack the revoked caller's connection"
        " can be closed before the reason has reached it: it takes that for an outage, and tries to connect"
        " for some seconds, in vain."
    ),
    ("drive.cpu",): (
        "a bar on the value itself, on two slow cores. Driven, the program takes 50 commands a second (the"
        " gateway drops the copies of the other lanes), publishes 50, and sends its guard 50 heartbeats."
    ),
    ("video.cpu", "video.cpu_in_turns"): (
        "what is above the reference is the pipe through which a frame's packets pass into a second"
        " pipeline (`preview/pipeline/framing.py`), and the hop between the camera's and the encoder's"
        " thread. In turns, what else the machine does differs between the two sides of a round."
    ),
    ("video.first_frame",): (
        "the reference waits for its next key frame, one a second, so its single waits are spread over more"
        " than a second. Both are connected to at moments spread evenly over that second."
    ),
    ("video.first_frame_ten_ms", "video.first_frame_ten_key_frames"): (
        "srtsink listens with a backlog of 1, so some of ten simultaneous SRT handshakes are refused; these"
        " viewers redial after 100 ms, and the slowest shows it."
    ),
    ("video.viewer_cpu",): (
        "a viewer costs 0.2 to 0.4 % of a core, and the rounds of the reference alone are 0.14 to 0.46 %: on"
        " this machine windows of 5 s differ by more than a bar of 1.25 allows."
    ),
    ("video.ros_camera_cpu",): (
        "what a topic costs more is the tap, 12 to 15 % of a core: it takes 41 MB/s out of Fast DDS, over"
        " UDP, and hands them to the preview, which needs up to 4 points more than with shmsrc."
    ),
    ("video.age_default",): (
        "webrtcbin's frame is decoded then, and ours is painted in the window. Its bar was kept on an AMD"
        " processor (8.9 against 6.1 ms, commit b15aab27); on this one both sides take longer."
    ),
    ("video.age_far_ms",): (
        "a frame has some ten packets here, so one in four loses one, and a lost packet comes again a round"
        " trip (80 ms) later at the earliest. The two or three frames behind it wait for it, because the"
        " decoder needs them in order. That is about three in five frames, so the median"
        " is close to a round trip: 56 to 80 ms in five rounds."
    ),
    ("video.age_narrow_fixed_worst_ms", "video.age_deep_fixed_worst_ms"): (
        "with a fixed bit rate above what the link carries, the pictures grow older until the viewer"
        " connects anew: at 0.6 s, or where none gets through any more, 0.6 s and a round trip after the last"
        " one. That one goes on ageing until the first new one has come through a queue that is still full."
    ),
    ("video.age_changing_freeze_ms", "video.age_changing_reconnects"): (
        "the link loses four fifths of its rate at once, in the middle of the stream. Its queue of 0.2 s is"
        " full and most packets are lost before the encoder sends less. 0.6 s and a round trip (0.2 s through"
        " the full queue) after the last whole frame the viewer connects anew. Its handshake waits for a"
        " quarter of a second behind what was sent to the old connection, and the key frame comes a tenth"
        " later."
    ),
    ("soak.rss_growth_mib",): (
        "resident memory moves by tens of MiB with what libsrt holds for the last few seconds; the lowest"
        " figures of an early and of the last window are compared."
    ),
    ("soak.gateway_rss_growth_mib", "soak.gateway_fds_growth"): (
        "the lowest figures of an early and of the last window are compared, as those of the preview service."
    ),
}
"""Text by the rows that it is about. A published row that misses its bar has one, with the reason."""


@dataclass(frozen=True, slots=True)
class Older:
    """Published figures that were measured in another way than these rows are now.

    Attributes:
        rows: patterns of their names, fnmatch(3).
        commits: that were measured so; a row of another commit is not meant.
        text: how they were measured.
    """

    rows: tuple[str, ...]
    commits: frozenset[str]
    text: str


OLDER: Final = (
    Older(
        ("drive.*",),
        frozenset({"648d6af8"}),
        "measured over the shared memory of Fast DDS. Containers and systemd units have"
        " `ROBOT_ROS_TRANSPORT=udp`, and since commit 333854a8 these rows have it, too: figures measured"
        " since then are not comparable with these.",
    ),
    Older(
        ("drive.*",),
        frozenset({"648d6af8"}),
        "measured with two lanes, against one where a row compares. Since commit 11d38fb6 a session has"
        " three.",
    ),
    Older(
        ("video.age_*_torn",),
        frozenset({"b15aab27"}),
        "counted by a mark of the decoder on frames that lack something. GStreamer's software decoder never"
        " sets it, so these zeros prove nothing. Now each frame that is shown is compared with what a decoder"
        " gives for the stream as the robot sent it, before the link loses anything.",
    ),
    Older(
        ("video.age_lossy", "video.age_very_lossy", "video.age_far"),
        frozenset({"b15aab27"}),
        "measured with the torn frames of the reference, which shows some, among its whole ones. Now they are"
        " left out on both sides.",
    ),
    Older(
        ("drive.stop_viewer_ms", "drive.stop_viewer_lossy_ms"),
        frozenset({"648d6af8"}),
        "measured on a robot at rest, by a gateway that asks for no login. Since then the robot is driven"
        " each time it is stopped, and driver and viewer have a login each.",
    ),
)
"""Such a remark is no reason why a row misses its bar. It is on the page until the rows are measured anew."""
