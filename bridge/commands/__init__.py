"""Requests of the hub to this robot: only those that the configuration allows, and never late.

| what comes | what follows |
|---|---|
| what is not this robot's, or names no possible command | acknowledged, counted, nothing else |
| more than 4 KiB, garbage, an unknown or a forbidden action, impossible values | REFUSED |
| an expired one, or one whose age is in doubt | EXPIRED |
| the same command once more | the first one's result is the only one |
| more than four at once, or more than one in ten seconds for long | they wait in the hub, and expire there |
| expired, refused and strange ones, more than two a second for long | they wait, and others behind them |
| the bridge ends before the gateway has answered | FAILED at the next start; not handed over again |

What is trusted: nothing but the hub's own clock for ages (`hub_time.py`), and nothing for the rest. The
bridge hands requests to the gateway, which decides once more, and carries them out.
"""
