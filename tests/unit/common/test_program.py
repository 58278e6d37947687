"""Programs run with as many descriptors as they may have, and with few arenas."""

import subprocess
import sys

PROGRAM = """
import asyncio, resource
from common.program import run

async def main(stop: asyncio.Event) -> None:
    print(*resource.getrlimit(resource.RLIMIT_NOFILE))

resource.setrlimit(resource.RLIMIT_NOFILE, (128, 512))
run(main)
"""


def test_the_soft_limit_of_descriptors_is_raised_to_the_hard_one() -> None:
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["512", "512"]


ARENAS = """
import ctypes, threading
from common.program import bound_arenas

bound_arenas()
c = ctypes.CDLL(None)
c.malloc.restype = ctypes.c_void_p
ready = threading.Barrier(9)

def allocate() -> None:
    c.malloc(100_000)
    ready.wait()

for _ in range(8):
    threading.Thread(target=allocate, daemon=True).start()
ready.wait()
c.malloc_info(0, ctypes.c_void_p.in_dll(c, "stdout"))
c.fflush(None)
"""


def test_threads_share_two_arenas() -> None:
    done = subprocess.run([sys.executable, "-c", ARENAS], capture_output=True, text=True, check=True)
    assert done.stdout.count("<heap nr=") <= 2
