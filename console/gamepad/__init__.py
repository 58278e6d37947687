"""Gamepads: hold to run by a shoulder button. `sdl.py` is the only file that knows SDL."""
