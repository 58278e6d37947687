"""The fleet's metrics for Prometheus: read from the hub alone, for enrolled robots only."""
