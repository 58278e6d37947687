"""Errors of the outbox."""


class OutboxError(Exception):
    """The outbox can't be read or written; the text says why, for people."""
