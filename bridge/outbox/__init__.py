"""The outbox: what is to be sent to the hub, on the robot's disk until the hub has it.

| what happens | what follows |
|---|---|
| the bridge is killed anywhere | a batch's bounds were on the disk before it was sent; it is sent again |
| more comes than fits | the oldest INFO goes first, then the oldest event; a gap takes its place |
| the disk is full, read-only or fails | `OutboxError`: nothing is taken from the gateway, which keeps 1024 |
| the database is damaged or gone | moved aside (one is kept); a new one begins after the last batch sent |
| the cursor is gone as well | the new one begins with the gateway's next event |
| it is lost while the bridge runs | what the old one had comes from the gateway once more, or is a gap |
| an event's payload is changed | a gap takes its place when it is to be sent |
| a row's run or number is changed | damaged, where it makes no sense or is the newest row's |
| a count or a command is changed | the count begins anew; the command has no result |
| the position is changed | damaged |
| a kill amid a new cursor left a file | removed at the next start |
| the WAL was cut | damaged if older than the cursor; otherwise the gateway has what is missing |
| it was made by a newer version | `OutboxError`, which says so; it is not touched |
| a second bridge is started | the database is locked; `OutboxError` |

What can't be had again is a gap: OUTBOX_LOST after a loss or a change, OUTBOX_FULL where there was no room.
"""
