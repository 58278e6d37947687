"""robotctl: a robot's status and preview from a terminal or a script."""

import os

from console.cli.lasting_imports import lasting_imports


def main() -> None:
    """The command's entry. Ends with the exit codes of `common.errors.ExitCode`."""
    # gRPC's own log lines would break into tables; what they say is in our errors. Read once, at its import.
    os.environ.setdefault("GRPC_VERBOSITY", "NONE")
    with lasting_imports():
        from console.cli.run import run  # noqa: PLC0415 - gRPC must not be imported before the line above

    run()
