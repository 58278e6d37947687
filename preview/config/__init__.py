"""The settings of the preview service; docs/configuration.md describes every key."""

from preview.config.settings import (
    AdaptiveSettings,
    AnyKind,
    CameraFormat,
    CameraTapSettings,
    FileSource,
    GstSource,
    PreviewSettings,
    ProfileSettings,
    ProfilesSettings,
    RosSource,
    Source,
    SrtSettings,
    TestSource,
    TimeoutSettings,
    V4l2Source,
)

__all__ = [
    "AdaptiveSettings",
    "AnyKind",
    "CameraFormat",
    "CameraTapSettings",
    "FileSource",
    "GstSource",
    "PreviewSettings",
    "ProfileSettings",
    "ProfilesSettings",
    "RosSource",
    "Source",
    "SrtSettings",
    "TestSource",
    "TimeoutSettings",
    "V4l2Source",
]
