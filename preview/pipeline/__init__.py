"""From a plan to a running pipeline. Together with encoders/, the only part that touches GStreamer."""
