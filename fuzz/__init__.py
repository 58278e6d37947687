"""Coverage-guided fuzzing of everything that reads what comes from outside.

`targets` says what is tried and what may come of it; `worker` tries each target in a process of its own;
`__main__` is `scripts/fuzz`.
"""

from typing import Final

OUTPUT: Final = "output"
"""File in the directory of a target: what its process has printed."""
