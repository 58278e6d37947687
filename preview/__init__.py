"""The video side: GStreamer pipelines on demand, served over SRT."""
