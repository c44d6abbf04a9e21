"""Posed RGB-D recordings on disk, one reader per format."""

from openmap_scenes.recordings.recording import Frame, Recording

__all__ = ["Frame", "Recording"]
