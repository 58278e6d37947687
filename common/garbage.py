"""Python's garbage collector in programs that must answer in time."""

import gc


def freeze_objects() -> None:
    """Excludes all objects that exist now from later collections, for good; for a program that has started.

    What it has built by then stays until its end, and a full collection would walk all of it while nothing
    else runs: 0.1 s in the gateway, for which every call would wait, and possibly longer than the patience
    that the guard of the drive program has with a silent worker.
    """
    gc.collect()
    gc.freeze()
