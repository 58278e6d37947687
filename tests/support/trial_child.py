"""The child's side of a trial, for tests: fails as it is asked to."""

import ctypes
import os

from common.errors import UserError
from common.trial_child import report


def main(how: str, what: str) -> None:
    """Ends in the given way."""
    match how:
        case "report":
            report(number=int(what))
        case "error":
            report(what)
        case "user error":
            raise UserError(what)
        case "signal":
            os.kill(os.getpid(), int(what))
        case "hang":
            # Keeps Python's lock, as in a driver.
            ctypes.PyDLL(None).sleep(60)
        case "nonsense":
            print("no JSON")
        case "flood":
            while True:
                print(what * 1000)
        case _:
            raise ValueError(how)
