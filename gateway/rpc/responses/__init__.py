"""Responses that all callers share: computed and serialised once."""
