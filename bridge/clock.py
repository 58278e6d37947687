"""Whether the calendar clock can be trusted, by the kernel's word (adjtimex(2))."""

import ctypes
import time
from typing import Final

_TIME_ERROR: Final = 5
"""Clock state of adjtimex(2): not synchronised. Setting the clock by hand causes it, too."""
_TIMEX_BYTES: Final = 512
"""More than struct timex has on any platform; zeros read without changing anything."""


def synchronised_unix_s() -> float | None:
    """Returns the calendar clock in seconds since 1970 UTC; None if the kernel has it not synchronised."""
    try:
        state = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.create_string_buffer(_TIMEX_BYTES))
    except AttributeError:
        return None  # Another C library.
    return time.time() if 0 <= state < _TIME_ERROR else None
