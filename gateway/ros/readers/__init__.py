"""The readers: each converts one message type into the value of a source.

They use attributes and import no message package, so that a robot without one of them loses nothing. Every
module in this folder is imported: docs/adding-a-source.md shows how to write one.
"""

from importlib import import_module
from pkgutil import iter_modules

from gateway.ros.readers.registry import Reader, is_header_and_list, reader_for, types_of

__all__ = ["Reader", "is_header_and_list", "reader_for", "types_of"]

for _module in iter_modules(__path__, f"{__name__}."):
    import_module(_module.name)
