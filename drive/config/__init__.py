"""The settings of the drive program; docs/configuration.md describes every key."""

from drive.config.settings import DriveSettings, Output

__all__ = ["DriveSettings", "Output"]
