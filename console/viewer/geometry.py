"""Geometry of the screen: a frame in a window, and a box of the source image on that frame. Pure."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle: x to the right, y down, from the upper left corner, in pixels."""

    x: float
    y: float
    width: float
    height: float

    @property
    def right(self) -> float:
        """The x of its right edge."""
        return self.x + self.width

    @property
    def bottom(self) -> float:
        """The y of its lower edge."""
        return self.y + self.height


def fitted(width: float, height: float, into: Box) -> Box:
    """Returns the largest centred rectangle of the shape width : height in another one (letterboxing).

    A side of 0 or less gives a rectangle without area in the centre.
    """
    scale = min(into.width / width, into.height / height) if width > 0 and height > 0 else 0.0
    shown_width, shown_height = width * max(scale, 0.0), height * max(scale, 0.0)
    return Box(
        into.x + (into.width - shown_width) / 2,
        into.y + (into.height - shown_height) / 2,
        shown_width,
        shown_height,
    )


def on_frame(box: Box, source_width: float, source_height: float, frame: Box) -> Box | None:
    """Maps a box of the source image to the shown frame, clipped; None if nothing of it is visible.

    The robot scales its camera's image into the frame without distorting it: a source of another shape than
    the frame has bars there, too.

    Args:
        box: in pixels of the source image.
        source_width: of the source image, in its pixels.
        source_height: of the source image, in its pixels.
        frame: where the frame is shown.
    """
    content = fitted(source_width, source_height, frame)
    if content.width <= 0 or content.height <= 0:
        return None
    scale = content.width / source_width
    left = max(content.x + box.x * scale, content.x)
    top = max(content.y + box.y * scale, content.y)
    right = min(content.x + box.right * scale, content.right)
    bottom = min(content.y + box.bottom * scale, content.bottom)
    # Compared this way round, a box with NaN is not visible either.
    if right > left and bottom > top:
        return Box(left, top, right - left, bottom - top)
    return None


def label_place(box: Box, width: float, height: float, frame: Box) -> Box:
    """Returns where the label of a box is drawn: above it, else inside it; never beyond the frame.

    Args:
        box: what is labelled.
        width: of the label.
        height: of the label.
        frame: where the frame is shown.
    """
    above = box.y - height
    y = above if above >= frame.y else min(box.y, frame.bottom - height)
    return Box(max(frame.x, min(box.x, frame.right - width)), y, width, height)
