"""The operator's windows: the only place that imports Qt."""
