"""The reference receiver: an SRT stream in, decoded frames out, with no frame held back on the way.

A `connection` fills a `frame_queue`. Only `connection`, `decoding`, `file_branch` and `decoder_trial` need
GStreamer; they are imported when the first connection is made.
"""
