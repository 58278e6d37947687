"""The fixtures of this folder."""

from tests.support.upload_ground import ground, secure, store_server  # noqa: F401  # pytest finds them here
