"""What Prometheus may read: off unless configured.

`calls` and `loop_delay` measure, `collector` tells them together with the newest snapshot, `endpoint` serves
the text. Nothing here is computed unless somebody asks for it, but for the two measurements.
"""
