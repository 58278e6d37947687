"""The reference receiver: an SRT stream in, decoded frames out, with no frame held back on the way.

A `connection` fills a `frame_queue`, by one of two siblings: `direct` takes packets as they arrive (`libsrt`,
`reception`, `reorder`, `transport_stream`, `unit_decoder`), `srt` leaves them to GStreamer's srtsrc. Only
these two and what they decode with need GStreamer; they are imported when the first connection is made.
"""
