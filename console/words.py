"""Alias of console.presentation.formatting, until viewer, monitor and window import that."""

from console.presentation.formatting import UNKNOWN, age, gibibytes, joined, plural, quantity, signed

__all__ = ["UNKNOWN", "age", "gibibytes", "joined", "plural", "quantity", "signed"]
