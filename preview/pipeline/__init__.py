"""One pipeline, from its plan to its teardown. Together with encoders/, the only part that uses GStreamer."""
