"""Square pixels for sources of untyped bytes: shared memory, a socket, a raw file.

The caps written behind such an element are all that is known of its frames, and they rarely state the pixel
aspect ratio. GStreamer leaves it open until videoscale negotiates it, and a capsfilter that would have to
choose one then fails ("Filter caps do not completely specify the output format"). Such caps mean square
pixels.
"""

from collections.abc import Iterator
from typing import Any, Final

from common.gst import Gst

_SQUARE: Final = "video/x-raw(ANY),pixel-aspect-ratio=1/1"
_TRANSPARENT: Final = frozenset({"queue", "queue2", "identity"})


def fill_in(source: Any) -> None:
    """Completes the caps behind sources of untyped bytes; other sources state their caps themselves.

    Args:
        source: bin that is not yet started.
    """
    for capsfilter in _capsfilters(source):
        if _follows_untyped_source(capsfilter):
            square = capsfilter.get_property("caps").intersect(Gst.Caps.from_string(_SQUARE))
            # Empty where the caps state another aspect ratio, or are not raw video.
            if not square.is_empty():
                capsfilter.set_property("caps", square)


def _capsfilters(source: Any) -> Iterator[Any]:
    elements = source.iterate_all_by_element_factory_name("capsfilter")
    while (step := elements.next())[0] == Gst.IteratorResult.OK:
        yield step[1]


def _follows_untyped_source(element: Any) -> bool:
    """Whether only transparent elements separate this one from a source that can't state its caps."""
    pad = element.get_static_pad("sink").get_peer()
    while pad is not None and (before := pad.get_parent_element()) is not None:
        if before.numsinkpads == 0:
            return bool(pad.query_caps(None).is_any())
        if before.get_factory().get_name() not in _TRANSPARENT:
            return False
        pad = before.get_static_pad("sink").get_peer()
    return False
