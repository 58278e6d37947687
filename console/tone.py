"""Alias of `SeverityStyle`, until the window imports it from console.presentation."""

from console.presentation.severity_style import SeverityStyle as Tone

__all__ = ["Tone"]
