"""The wish here, the truth there: what the operator wants of the preview, and what the service makes of it.

The gateway owns the wish and applies it until the preview service has it; the service owns the truth and
tells it in a stream. No request of an operator waits for the service longer than its own limit.

What goes wrong, what the status says then, and what the gateway does:

service absent at start, or gone
    Says FAULTED "preview service unreachable" when wanted, DISABLED when not.
    Tries again after 0.1, 0.2, 0.4 ... 1 s, and at once when an operator asks.
service comes (back) with an empty memory
    Says what the service says. Applies the wish again and counts a restart when a pipeline starts.
service frozen: no word for 2.5 s, or a wish not taken in for 2 s
    As gone. Drops the connection; each further attempt gives up after 2.5 s.
service refuses the wish
    Says FAULTED with the service's words. Waits for the next wish or the next process of the service.
service speaks a state that this gateway does not know
    As gone, naming the cause.
service has a newer revision than ours: a second gateway spoke to it
    Says what the service says. Numbers its own wish above and applies it, with pauses.
gateway restarted, nobody has asked since
    Says what the service says, and takes the service's wish over: the picture goes on. An encrypted one
    starts again with a new passphrase, because nobody knows the old one.
operators ask at the same time
    The newest wish counts; the answers to the others say that they were replaced.

Files: wish.py and actual.py are what is wanted and what is; reconciler.py decides and counters.py counts
(both pure); wire.py speaks the service's schema, link.py keeps the connection, control.py answers operators.
"""
