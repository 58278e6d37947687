"""Viewing a robot's preview: which stream to connect to, when to redial, and the state that a screen shows.

`session.VideoSession` keeps the latest frame and its playback state; `robot_video.RobotVideo` adds the
gateway's status. Nothing here knows Qt; GStreamer is behind `console.receiver` and imported when the first
connection is made. `console.window.video_view` paints.
"""
