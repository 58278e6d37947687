"""Model of the monitor window, without Qt.

`worker` talks to the gateway in a thread of its own and keeps the latest `monitor_state`; the other modules
format a state as texts, styles and figures. `console.window` paints them.
"""
