"""One servicer per resource. A handler receives, maps, calls, maps and replies."""
