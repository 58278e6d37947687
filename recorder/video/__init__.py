"""Video of the preview's encoder as messages of a recording."""
