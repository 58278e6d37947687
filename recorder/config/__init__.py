"""The settings of the recorder; docs/configuration.md describes every key."""

from recorder.config.settings import MIB, PresetSettings, RecorderSettings

__all__ = ["MIB", "PresetSettings", "RecorderSettings"]
