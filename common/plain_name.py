"""Names of robots where not every character may stand: in a file's name, a DNS label, a command."""

import re


def plain_name(name: str, longest: int, *, also: str = "") -> str:
    """Returns a name of ASCII letters, digits, single hyphens and `also`; "robot" where none is left.

    Args:
        name: any text; it may come from another machine.
        longest: number of characters that are kept.
        also: further characters that are permitted, none at either end.
    """
    plain = re.sub(rf"[^A-Za-z0-9{re.escape(also)}]+", "-", name)
    return plain[:longest].strip("-" + also) or "robot"
