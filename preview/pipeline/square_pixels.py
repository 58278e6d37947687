"""Fills in what a source leaves open that knows nothing of its pictures: shared memory, a socket, a raw file.

Such an element sends bytes, and the caps written behind it are all that is known of them. They rarely name
the shape of a pixel. GStreamer leaves it open as long as nobody asks, but scaling asks, offers any shape, and
a capsfilter that would have to choose fails ("Filter caps do not completely specify the output format").
Square is what such caps mean.
"""

from collections.abc import Iterator
from typing import Any, Final

from common.gst import Gst

_SQUARE: Final = "video/x-raw(ANY),pixel-aspect-ratio=1/1"
_PASSING_ON: Final = frozenset({"queue", "queue2", "identity"})


def fill_in(source: Any) -> None:
    """Makes caps behind a source of mere bytes complete. Others say themselves what they send.

    Args:
        source: a bin that is not yet started.
    """
    for capsfilter in _capsfilters(source):
        if _gets_mere_bytes(capsfilter):
            square = capsfilter.get_property("caps").intersect(Gst.Caps.from_string(_SQUARE))
            # Empty where the caps name another shape, or something that is not a picture.
            if not square.is_empty():
                capsfilter.set_property("caps", square)


def _capsfilters(source: Any) -> Iterator[Any]:
    elements = source.iterate_all_by_element_factory_name("capsfilter")
    while (step := elements.next())[0] == Gst.IteratorResult.OK:
        yield step[1]


def _gets_mere_bytes(element: Any) -> bool:
    pad = element.get_static_pad("sink").get_peer()
    while pad is not None and (before := pad.get_parent_element()) is not None:
        if before.numsinkpads == 0:
            return bool(pad.query_caps(None).is_any())
        if before.get_factory().get_name() not in _PASSING_ON:
            return False
        pad = before.get_static_pad("sink").get_peer()
    return False
