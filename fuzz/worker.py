"""One target in a process of its own: libFuzzer ends the process when it is done, or when it found something.

python -m fuzz.worker TARGET RUNS DIRECTORY     tries RUNS inputs; the corpus grows in DIRECTORY
python -m fuzz.worker TARGET FILE               tries one input again
python -m fuzz.worker --list                    names the targets
"""

import sys
from pathlib import Path
from typing import Final

import atheris

_LONGEST_INPUT: Final = 4096
_DEADLINE_S: Final = 10
"""For one input: what takes longer hangs."""
_MEMORY_MIB: Final = 1024


def main(arguments: list[str]) -> None:
    """Returns only when it lists."""
    with atheris.instrument_imports(include=["common", "console", "gateway", "preview"]):
        from fuzz import seeds  # noqa: PLC0415
        from fuzz.targets import TARGETS  # noqa: PLC0415
    if arguments == ["--list"]:
        print(*TARGETS)
        return
    name, what, *directory = arguments
    options = [f"-timeout={_DEADLINE_S}", f"-rss_limit_mb={_MEMORY_MIB}", f"-max_len={_LONGEST_INPUT}"]
    if directory:
        corpus = Path(directory[0])
        for index, seed in enumerate(seeds.of(name)):
            (corpus / f"seed-{index}").write_bytes(seed)
        options += [
            f"-runs={what}",
            "-print_final_stats=1",
            f"-artifact_prefix={corpus.parent}/",
            str(corpus),
        ]
    else:
        options.append(what)
    atheris.Setup([sys.argv[0], *options], TARGETS[name])
    atheris.Fuzz()


if __name__ == "__main__":
    main(sys.argv[1:])
