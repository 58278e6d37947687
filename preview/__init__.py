"""Preview service: GStreamer pipelines on demand, served over SRT."""
