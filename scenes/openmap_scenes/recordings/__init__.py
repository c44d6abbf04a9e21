"""Posed RGB-D recordings on disk, one reader per format."""

from openmap_scenes.recordings.opening import open_recording
from openmap_scenes.recordings.recording import Frame, Recording

__all__ = ["Frame", "Recording", "open_recording"]
