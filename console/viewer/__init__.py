"""Watching a robot's preview: which stream to call, when to call again, what to say when no picture comes.

`session.VideoSession` keeps the newest picture and a state that a screen shows. Nothing here knows Qt;
GStreamer is behind `console.receiver` and imported when the first call is made. `console.window.video_view`
paints.
"""
