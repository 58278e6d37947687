"""Values that the recorder's packages share: channels, samples, losses, what a finished segment contains."""

from recorder.values.items import VIDEO_TOPIC, Channel, Ended, GapCause, Item, Loss, Note, Sample
from recorder.values.segments import ChannelSummary, Gap, Losses, SegmentSummary

__all__ = [
    "VIDEO_TOPIC",
    "Channel",
    "ChannelSummary",
    "Ended",
    "Gap",
    "GapCause",
    "Item",
    "Loss",
    "Losses",
    "Note",
    "Sample",
    "SegmentSummary",
]
