"""`robot-tap doctor`: the configuration, the running program, and the image topics of the graph.

Each topic is looked at as the tap itself would take it: its first message says whether it can be shown, how
large its pictures are, and whether its stamps are capture times.
"""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Final

from common.config_finding import checked_settings
from common.errors import UserError
from common.findings import Finding, good, note, wrong
from common.receive_time import present_instant
from common.ros_transport_findings import transport_finding
from tap.capture_time import CaptureTimes
from tap.client import observed_state
from tap.config import TapSettings
from tap.image import READERS, Frame
from tap.refusal import RefusedError

if TYPE_CHECKING:
    from tap.camera import Camera

DISCOVERY_S: Final = 3.0
_MESSAGE_WITHIN_S: Final = 2.0
_DISCOVERIES: Final = 5
_MAX_TOPICS: Final = 32
_NO_SHOW: Final = "A camera of the preview with this topic fails"


def examine(config_file: Path | None) -> Iterator[Finding]:
    """Yields the findings on this machine.

    Args:
        config_file: of the program.
    """
    settings = yield from checked_settings(TapSettings, config_file, "robot-tap")
    if settings is None:
        return
    try:
        yield from program_findings(observed_state(settings.socket))
    except UserError as error:
        yield note("tap", error.what, "Cameras of kind ros can't be shown", error.remedy)
    try:
        yield from _graph()
    except UserError as error:
        yield wrong("ros", error.what, "Without ROS 2 there are no topics", error.remedy)


def program_findings(state: dict[str, object]) -> Iterator[Finding]:
    """Yields what the state of the running program says."""
    wanted, topics = state.get("wanted"), state.get("topics")
    names = ", ".join(map(str, wanted)) if isinstance(wanted, list) else ""
    yield good("tap", f"it runs; wanted at present: {names or 'no camera'}")
    for topic, counts in topics.items() if isinstance(topics, dict) else ():
        refused = {name: count for name, count in counts["refused"].items() if count}
        if refused:
            reasons = ", ".join(f"{count} {name}" for name, count in refused.items())
            yield note(
                f"tap.{topic}",
                f"messages were refused: {reasons}",
                "Those were not shown",
                "The log of robot-tap says what is wrong with them",
            )


def _graph() -> Iterator[Finding]:
    # Late: without ROS 2 the rest is still examined.
    from common.ros_node import OwnNode, middleware_name, readable_names, ros_node  # noqa: PLC0415
    from tap.camera import Camera, Graph  # noqa: PLC0415

    yield from transport_finding(middleware_name())
    with ros_node(OwnNode.TAP_DOCTOR) as node, readable_names():
        found = _discovered(
            lambda: sorted(
                name
                for name, types in node.get_topic_names_and_types()
                if any(each in READERS for each in types)
            )
        )
        if not found:
            yield note(
                "topics",
                "the graph has no image topics",
                "Cameras of kind ros have nothing to show",
                "Start the camera's node, in the same ROS_DOMAIN_ID and as ROS_AUTOMATIC_DISCOVERY_RANGE"
                " permits",
            )
        graph = Graph(node)
        for topic in found[:_MAX_TOPICS]:
            camera = Camera(graph, topic)
            try:
                yield _look(camera, topic)
            finally:
                camera.close()


def _discovered(topics: Callable[[], list[str]]) -> list[str]:
    """Returns the topics once two looks DISCOVERY_S apart agree, after _DISCOVERIES looks at most.

    An empty graph is looked at twice, too: a participant whose first announcements were missed announces
    itself again after 3 s (Fast DDS, leaseAnnouncement), which is as long as the first look waits.
    """
    before: list[str] | None = None
    found: list[str] = []
    for _ in range(_DISCOVERIES):
        time.sleep(DISCOVERY_S)  # Polled as well, an empty graph would take all of it.
        found = topics()
        if found == before:
            break
        before = found
    return found


def _look(camera: "Camera", topic: str) -> Finding:
    camera.examine()
    check = f"topic.{topic}"
    if camera.problem:
        return note(check, camera.problem, _NO_SHOW, "Start the camera's node")
    taken = camera.take() if camera.wait(_MESSAGE_WITHIN_S) else None
    if taken is None:
        return note(
            check,
            f"{topic} had no message in {_MESSAGE_WITHIN_S:g} s",
            _NO_SHOW,
            "Look at the camera's node: it is there, but publishes nothing that arrives",
        )
    try:
        frame = READERS[camera.type_name](taken[0])
    except RefusedError as error:
        return wrong(
            check,
            f"a message of {topic} {error.text}",
            _NO_SHOW,
            "Choose another encoding in the camera's node",
        )
    return stamp_finding(check, topic, frame)


def stamp_finding(check: str, topic: str, frame: Frame) -> Finding:
    """Returns the finding on a message that can be shown."""
    times, now = CaptureTimes(), present_instant()
    times.of(frame.stamp_ns, int(now.monotonic_s * 1e9), now)
    what = f"{topic}: {frame.width}x{frame.height} pixels, {frame.form}"
    if not times.replaced:
        return good(check, what)
    return note(
        check,
        f"{what}; its stamp is {(now.system_ns - frame.stamp_ns) / 1e9:.1f} s old",
        "Pictures count as captured when they arrive, so their age is shown too small",
        "Have the camera's node stamp its messages by this machine's clock",
    )
