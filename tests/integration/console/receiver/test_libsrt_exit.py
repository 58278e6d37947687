"""A program that has used libsrt, through GStreamer as well, ends without a crash, whatever libsrt is at."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.gst

ROOT = Path(__file__).parents[4]
PROGRAM = """
import ctypes, sys, time
from common.gst import Gst
from console.receiver.libsrt import SrtSocket
element = Gst.ElementFactory.make("srtsrc")
ctypes.pythonapi.Py_IncRef(ctypes.py_object(element))  # as a reference cycle may keep it beyond the end
for _ in range(300):
    made = SrtSocket("127.0.0.1", 9, 20, "")
    made.connect()
    made.close()
time.sleep(float(sys.argv[1]))
"""
"""libsrt frees closed sockets after a second, in its own thread."""
ENDS_AFTER_S = (0.80, 0.84, 0.88, 0.92, 0.96, 1.00, 1.04, 1.08)


def test_the_end_of_a_program_does_not_meet_the_end_of_its_sockets() -> None:
    programs = [
        subprocess.Popen(
            [sys.executable, "-c", PROGRAM, str(each)], cwd=ROOT, stderr=subprocess.PIPE, text=True
        )
        for each in ENDS_AFTER_S
    ]
    ended = [(each.communicate(timeout=60)[1], each.returncode) for each in programs]
    assert ended == [("", 0)] * len(programs)
