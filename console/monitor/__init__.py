"""What the monitor window shows, worked out without Qt.

`worker` talks to the gateway in a thread of its own and keeps the newest `state`; the other modules turn a
state into words, tones and figures. `console.window` paints them.
"""
