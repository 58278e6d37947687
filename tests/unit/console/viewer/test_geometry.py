import pytest

from console.viewer.geometry import Box, fitted, label_place, on_frame

WINDOW = Box(0, 0, 1600, 900)


@pytest.mark.parametrize(
    ("width", "height", "shown"),
    [
        pytest.param(1280, 720, Box(0, 0, 1600, 900), id="same shape: no bars"),
        pytest.param(640, 480, Box(200, 0, 1200, 900), id="narrower: bars left and right"),
        pytest.param(1600, 400, Box(0, 250, 1600, 400), id="wider: bars above and below"),
        pytest.param(3200, 1800, Box(0, 0, 1600, 900), id="larger: scaled down"),
    ],
)
def test_a_frame_fills_its_window_as_far_as_its_shape_allows(width: int, height: int, shown: Box) -> None:
    assert fitted(width, height, WINDOW) == shown


@pytest.mark.parametrize("size", [(0, 100), (100, 0), (0, 0), (-1, 5)])
def test_what_has_no_size_fits_nowhere(size: tuple[int, int]) -> None:
    shown = fitted(*size, WINDOW)
    assert shown.width == shown.height == 0


def test_a_window_without_room_shows_nothing() -> None:
    assert fitted(1280, 720, Box(0, 0, 0, 0)).width == 0
    assert on_frame(Box(0, 0, 10, 10), 1280, 720, Box(5, 5, 0, 0)) is None


def test_a_box_is_scaled_with_the_frame_and_moves_with_it() -> None:
    frame = Box(100, 50, 640, 360)
    assert on_frame(Box(320, 180, 640, 360), 1280, 720, frame) == Box(260, 140, 320, 180)


def test_a_source_of_another_shape_has_bars_inside_the_frame() -> None:
    """A 4:3 camera in a 16:9 frame: scaled to 960x720, 160 px of bar on each side."""
    whole = on_frame(Box(0, 0, 640, 480), 640, 480, Box(0, 0, 1280, 720))
    assert whole == Box(160, 0, 960, 720)


def test_a_box_ends_where_the_frame_does() -> None:
    frame = Box(0, 0, 640, 360)
    assert on_frame(Box(-100, -100, 200, 200), 1280, 720, frame) == Box(0, 0, 50, 50)
    assert on_frame(Box(1200, 700, 500, 500), 1280, 720, frame) == Box(600, 350, 40, 10)


@pytest.mark.parametrize("box", [Box(1280, 0, 10, 10), Box(0, -20, 10, 20), Box(5, 5, 0, 10)])
def test_a_box_outside_the_frame_or_without_area_is_not_drawn(box: Box) -> None:
    assert on_frame(box, 1280, 720, Box(0, 0, 640, 360)) is None


def test_a_box_that_is_not_a_number_is_not_drawn() -> None:
    assert on_frame(Box(float("nan"), 0, 10, 10), 1280, 720, Box(0, 0, 640, 360)) is None
    assert on_frame(Box(0, 0, float("nan"), 10), 1280, 720, Box(0, 0, 640, 360)) is None


FRAME = Box(100, 50, 800, 450)


@pytest.mark.parametrize(
    ("box", "place"),
    [
        pytest.param(Box(200, 200, 80, 80), Box(200, 180, 120, 20), id="above"),
        pytest.param(Box(200, 55, 80, 80), Box(200, 55, 120, 20), id="no room above"),
        pytest.param(Box(850, 200, 50, 80), Box(780, 180, 120, 20), id="at the right edge"),
        pytest.param(Box(100, 50, 800, 450), Box(100, 50, 120, 20), id="the whole frame"),
        pytest.param(Box(100, 495, 20, 5), Box(100, 475, 120, 20), id="at the bottom"),
    ],
)
def test_a_label_stays_in_the_frame(box: Box, place: Box) -> None:
    assert label_place(box, 120, 20, FRAME) == place


def test_a_label_wider_than_the_frame_begins_at_its_left_edge() -> None:
    assert label_place(Box(500, 200, 10, 10), 2000, 20, FRAME).x == FRAME.x
