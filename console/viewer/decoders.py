"""Who makes the pictures: hardware decoders that have proven themselves, else software."""

from collections.abc import Mapping

from console.receiver.errors import StreamError, UndecodableError


class Decoders:
    """The choice for one session."""

    def chosen(self) -> Mapping[str, str]:
        """GStreamer's element by codec; a codec that is not named is decoded in software."""
        return {}

    def replaced_after(self, trouble: UndecodableError) -> StreamError:
        """What a call ended with that met something undecodable."""
        return trouble
