"""From the queue to the files: one thread writes."""
