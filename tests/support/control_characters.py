"""The characters that a terminal does not print but obeys."""

from typing import Final

CONTROL_CHARACTERS: Final = "".join(
    chr(point)
    for point in (
        *range(0x20),  # C0: escape sequences, line feeds
        *range(0x7F, 0xA0),  # DEL and C1
        0x061C,  # the Arabic letter mark
        *range(0x200E, 0x2010),  # marks of direction
        *range(0x2028, 0x202F),  # line and paragraph separator, embeddings and overrides of direction
        *range(0x2066, 0x206A),  # isolates
        0xFEFF,
        *range(0xE0000, 0xE0080),  # invisible tags
    )
)
