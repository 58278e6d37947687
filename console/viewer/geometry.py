"""Where things go: a picture in a window, and a box of the source image on that picture. Pure."""

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
    """The largest rectangle of the shape width : height in the middle of another: what is left are bars.

    Nothing fits where a side is 0 or less: that gives a rectangle without area in the middle.
    """
    scale = min(into.width / width, into.height / height) if width > 0 and height > 0 else 0.0
    shown_width, shown_height = width * max(scale, 0.0), height * max(scale, 0.0)
    return Box(
        into.x + (into.width - shown_width) / 2,
        into.y + (into.height - shown_height) / 2,
        shown_width,
        shown_height,
    )


def on_picture(box: Box, source_width: float, source_height: float, picture: Box) -> Box | None:
    """Where a box of the source image lies on the shown picture; None when nothing of it is to be seen.

    The robot scales its camera's image into the picture without distorting it: a source of another shape than
    the picture has bars there, too.

    Args:
        box: in pixels of the source image.
        source_width: of the source image, in its pixels.
        source_height: of the source image, in its pixels.
        picture: where the picture is shown.
    """
    content = fitted(source_width, source_height, picture)
    if content.width <= 0 or content.height <= 0:
        return None
    scale = content.width / source_width
    left = max(content.x + box.x * scale, content.x)
    top = max(content.y + box.y * scale, content.y)
    right = min(content.x + box.right * scale, content.right)
    bottom = min(content.y + box.bottom * scale, content.bottom)
    # Asked this way round, a box that is not a number is not seen either.
    if right > left and bottom > top:
        return Box(left, top, right - left, bottom - top)
    return None
