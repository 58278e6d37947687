"""A guarded gateway under attack while an operator works: what the operator notices, and what it costs.

In turns, the operator is measured alone, beside programs that only take the attackers' core, and besieged, by
the same clients. Attackers are programs of their own with the same priority as all others, on one core of
this machine; on a robot they would run on other machines. They call from other addresses of this machine than
the operator, in each turn from new ones, and return when cut off. A turn begins with their first connections.
The operator's own address is 127.0.0.1, which the gateway always trusts; some logins come from addresses that
it has never heard of.
Against a deployment: `python -m bench.siege --help`.
"""

import tempfile
from pathlib import Path

from bench.rows import Row
from bench.siege.ground import own_ground
from bench.siege.judgement import measured
from bench.siege.size import FULL


def run(names: list[str]) -> list[Row]:
    with tempfile.TemporaryDirectory() as directory, own_ground(Path(directory)) as ground:
        rows = measured(ground, FULL)
    return [row for row in rows if not names or row.name in names]
