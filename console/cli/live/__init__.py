"""robotctl watch on a terminal: a table redrawn in place, and keys for the preview."""
