"""The only import of `gi` in the project; all users of GStreamer import it from here.

Without GStreamer or PyGObject, importing this module raises a `UserError` that says what to install. It is
therefore imported late, by code that is about to build a pipeline.
"""

import ctypes
from contextlib import suppress
from typing import Any, Final

from common.errors import UserError

# GStreamer's core brings libunwind, which defines the same _Unwind_* symbols as libgcc_s. In a process that
# loaded the C++ runtime before GStreamer (importing grpc does), libsrt would throw its exceptions with one
# of the two and catch them with the other, which aborts the process when an SRT element stops. With
# libgcc_s in the global scope, every library resolves to the same one in any order of imports.
with suppress(OSError):
    ctypes.CDLL("libgcc_s.so.1", mode=ctypes.RTLD_GLOBAL)

try:
    import gi

    gi.require_version("Gst", "1.0")
    gi.require_version("GstAllocators", "1.0")
    gi.require_version("GstVideo", "1.0")
    from gi.repository import Gio as _Gio
    from gi.repository import GLib as _GLib
    from gi.repository import GObject as _GObject
    from gi.repository import Gst as _Gst
    from gi.repository import GstAllocators as _GstAllocators
    from gi.repository import GstVideo as _GstVideo
except (ImportError, ValueError) as error:
    raise UserError(
        f"GStreamer can't be used from Python ({error})",
        "Type: scripts/setup, or install gir1.2-gstreamer-1.0, gir1.2-gst-plugins-base-1.0 and PyGObject",
    ) from error

# gi builds these at run time from typelibs; no stub describes them well enough.
Gst: Final[Any] = _Gst
GstAllocators: Final[Any] = _GstAllocators
GstVideo: Final[Any] = _GstVideo
GLib: Final[Any] = _GLib
GObject: Final[Any] = _GObject
# srtsink's statistics hold socket addresses as Gio objects.
Gio: Final[Any] = _Gio

Gst.init(None)


def stop(pipeline: Any) -> None:
    """Sets a pipeline and every element in it to NULL.

    Gst.Bin gives up at the first child that fails, which leaves those upstream of it PLAYING; freed in that
    state, they crash the process. A child fails whose driver did not open, and that has not been stopped yet.
    """
    if pipeline.set_state(Gst.State.NULL) != Gst.StateChangeReturn.FAILURE:
        return
    # The newest child is first in the list: from the source on, so that nothing flows into what has stopped.
    for child in reversed(pipeline.children):
        stop_element(child)
    pipeline.set_state(Gst.State.NULL)


def stop_element(element: Any) -> None:
    """Sets an element to NULL, locked: a state change of its pipeline does not restart it."""
    element.set_locked_state(True)
    element.set_state(Gst.State.NULL)
