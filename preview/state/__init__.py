"""The state of the preview, desired and actual: its values, its lifecycle and its cameras. Pure."""
