"""The examples of docs/configuration.md, as they stand there."""

import re
import textwrap
from pathlib import Path
from typing import Final

THREE_CAMERAS: Final = "Two USB cameras and a ROS topic"
"""The section that a robot with these cameras is set up by."""
_PAGE: Final = Path(__file__).parents[2] / "docs/configuration.md"


def documented(key: str, section: str) -> str:
    """Returns the one block of a section that begins with a key."""
    text = _PAGE.read_text(encoding="utf-8").partition(f"\n### {section}\n")[2].partition("\n## ")[0]
    blocks = re.findall(r"^ *```yaml\n(.*?)^ *```", text, re.MULTILINE | re.DOTALL)
    (found,) = [block for each in blocks if (block := textwrap.dedent(each)).startswith(f"{key}:\n")]
    return found
