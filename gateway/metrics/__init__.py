"""Metrics for Prometheus; off unless configured.

`calls` and `loop_delay` measure all the time; `collector` computes the rest on request, from the newest
snapshot; `common.metrics_endpoint` serves the text.
"""
