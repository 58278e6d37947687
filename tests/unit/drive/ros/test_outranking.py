"""Whether the base follows another source, judged by what reaches it."""

from drive.motion.values import MS, ZERO, Velocity
from drive.ros.outranking import Outranking

OURS = Velocity(vx_mps=0.2)
THEIRS = Velocity(vx_mps=0.4)


def driven(outranking: Outranking, from_ms: int, until_ms: int, reaching: Velocity | None) -> None:
    """Publishes motion every 20 ms, while something reaches the base."""
    for ms in range(from_ms, until_ms, 20):
        outranking.published(OURS, ms * MS)
        if reaching is not None:
            outranking.seen(reaching, (ms + 5) * MS)


def test_what_is_published_here_reaches_the_base() -> None:
    outranking = Outranking()
    driven(outranking, 0, 2000, OURS)
    assert not outranking.outranked(2000 * MS)


def test_another_source_is_noticed_after_300_ms() -> None:
    outranking = Outranking()
    driven(outranking, 0, 1000, OURS)
    driven(outranking, 1000, 1280, THEIRS)
    assert not outranking.outranked(1280 * MS)
    driven(outranking, 1280, 1400, THEIRS)
    assert outranking.outranked(1400 * MS)


def test_zeros_of_an_idle_source_and_silence_count_as_well() -> None:
    for reaching in (ZERO, None):
        outranking = Outranking()
        driven(outranking, 0, 300, reaching)
        assert not outranking.outranked(300 * MS)
        driven(outranking, 300, 340, reaching)
        assert outranking.outranked(340 * MS)


def test_without_motion_of_ours_only_foreign_motion_counts() -> None:
    outranking = Outranking()
    outranking.published(ZERO, 0)
    outranking.seen(ZERO, 100 * MS)
    assert not outranking.outranked(1000 * MS)
    outranking.seen(THEIRS, 1000 * MS)
    assert outranking.outranked(1300 * MS)
    assert not outranking.outranked(1301 * MS)
    assert outranking.foreign_motion_ns == 1000 * MS


def test_a_velocity_of_a_moment_ago_is_still_ours() -> None:
    outranking = Outranking()
    outranking.published(OURS, 0)
    outranking.published(ZERO, 100 * MS)
    outranking.seen(OURS, 120 * MS)
    assert not outranking.outranked(120 * MS)


def test_not_a_number_is_never_ours() -> None:
    outranking = Outranking()
    driven(outranking, 0, 400, Velocity(vx_mps=float("nan")))
    assert outranking.outranked(400 * MS)
