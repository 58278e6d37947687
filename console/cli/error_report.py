"""An error as robotctl reports it: one line, or one JSON document."""

import json
import sys
from typing import Any

from common.errors import ExitCode, UserError
from common.printable import escaped
from console.cli.refusal_commands import COMMANDS
from console.cli.typed_options import typed_options


def error_as_json(error: UserError) -> dict[str, Any]:
    """Returns the JSON form of an error."""
    own = "usage" if error.exit_code is ExitCode.USAGE else "failed"
    return {
        "kind": error.kind or own,
        "what": " ".join(error.what.split()),
        "remedy": typed_options(sys.argv[1:]).repeated_in(_remedy(error)),
        "exit_code": int(error.exit_code),
    }


def report(error: UserError) -> None:
    """Prints an error on one line of standard error; as JSON where the command line has --json."""
    if "--json" in sys.argv[1:]:
        print(escaped(json.dumps({"error": error_as_json(error)}, ensure_ascii=False)), file=sys.stderr)
    else:
        text = str(UserError(error.what, _remedy(error)))
        print(f"error: {typed_options(sys.argv[1:]).repeated_in(text)}", file=sys.stderr)


def _remedy(error: UserError) -> str:
    # Only refusals of a gateway have a reason; importing their class would take long.
    return COMMANDS.get(getattr(error, "reason", ""), error.remedy)
