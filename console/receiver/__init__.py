"""The reference receiver: an SRT stream in, decoded pictures out, nothing held back on the way.

`console.receiver.receiver.Receiver` is what callers use. Only `connection` and `decoding` need GStreamer;
they are imported when the first connection is made.
"""
