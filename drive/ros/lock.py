"""The lock of the robot's multiplexer, which other programs may publish as well.

The multiplexer keeps the last message, whichever program it came from: a release would end another program's
lock, too.
"""

from typing import Final, Protocol

from drive.motion.values import DISCOVERY_NS, MS

_LOOK_EVERY_NS: Final = 500 * MS
"""At the graph: who publishes."""
_TAKE_EVERY_NS: Final = 100 * MS
_OWN_ECHO_NS: Final = 200 * MS
"""What was published here has come back by then."""


class TopicPort(Protocol):
    """What the lock needs of its topic (drive.ros.lock_topic.LockTopic)."""

    name: str

    def publish(self, *, active: bool) -> None:
        """Publishes the lock, or its release."""

    def newest(self) -> bool | None:
        """Returns what was published last, here or by another program; None if there is nothing new."""

    def others(self) -> tuple[str, ...]:
        """Returns the nodes of other programs that publish here, as far as they are discovered."""


class Lock:
    """Publishes the lock, and its release where that can only end a lock of this program.

    Args:
        topic: of the lock.
        began_ns: when this program joined the graph: other publishers are not discovered at once, and until
            they are, it is not known whether there are any.
        left: whether an earlier process has left the lock active; its messages do not come again.
    """

    def __init__(self, topic: TopicPort, began_ns: int, *, left: bool) -> None:
        self._topic = topic
        self._known_ns = began_ns + DISCOVERY_NS
        self._wanted, self._active = False, left
        """For a stop; and as it was published last, here or by another program."""
        self._discovered = False
        """Whether there was time to discover other programs."""
        self._waits = False
        """Whether a release waits until it is known which other programs publish."""
        self._others: tuple[str, ...] = ()
        """Nodes that publish it, too, when last looked for."""
        self._looked_ns = self._take_due_ns = 0
        self.left = left
        """Whether it was published by this program, and is not known to be released since."""

    def publish(self, now_ns: int, *, active: bool) -> bool:
        """Locks; or releases, unless another program may hold the lock.

        Returns:
            Whether that is decided; False where a release has to be requested again later.
        """
        self._wanted = active
        self._waits = not active and now_ns < self._known_ns
        if active:
            self._active = self.left = True
            self._topic.publish(active=True)
        elif not self._waits:
            self._release(now_ns)
        return not self._waits

    def observe(self, now_ns: int) -> None:
        """Takes what has arrived; while the lock is active, looks for other programs that publish it."""
        if now_ns >= self._take_due_ns:
            self._take_due_ns = now_ns + _TAKE_EVERY_NS
            newest = self._topic.newest()
            if newest is not None:
                self._active = newest
                self.left = self.left and (newest or self._wanted)
        self._discovered = now_ns >= self._known_ns
        if self._active and now_ns - self._looked_ns >= _LOOK_EVERY_NS:
            self._looked_ns = now_ns
            self._others = self._topic.others()

    @property
    def problem(self) -> str:
        """Why the lock is active without a stop, or will be after its reset, for people; empty otherwise."""
        names, topic = ", ".join(self._others), self._topic.name
        if self._wanted:
            return (
                f"{names} publishes the lock on {topic}, too: the reset of a stop does not release it"
                if names
                else ""
            )
        if not self._active:
            return ""
        if self._waits and not names:
            return (
                f"the lock on {topic} is still active: until {DISCOVERY_NS // 10**9} s after the start of "
                "robot-drive it is not known whether another program publishes it. If none does, it is "
                "released then"
            )
        unnamed = "by a program that has gone" if self._discovered else "it is not known yet by which program"
        return (
            f"the lock on {topic} is active, and nothing of lower priority moves the robot: release it "
            f"where it was pressed ({names or unnamed}); if it is only left of a stop, "
            f"type: ros2 topic pub --once {topic} std_msgs/msg/Bool '{{data: false}}'"
        )

    def _release(self, now_ns: int) -> None:
        self._others = self._topic.others()
        if not self._others:
            self._active = self.left = False
            self._take_due_ns = now_ns + _OWN_ECHO_NS
            self._topic.publish(active=False)
