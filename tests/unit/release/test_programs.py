"""What a release has for robots without Docker is what scripts/install-robot installs."""

import re
from pathlib import Path

from release_program.programs import PROGRAMS

ROOT = Path(__file__).parents[3]


def test_its_lock_files_are_those_that_are_installed() -> None:
    script = (ROOT / "scripts/install-robot").read_text(encoding="utf-8")
    installed = re.findall(r'^  for name in ([\w -]+) \$\(\[ "\$ros" = packages \]', script, re.MULTILINE)
    assert installed == [" ".join(PROGRAMS)]
