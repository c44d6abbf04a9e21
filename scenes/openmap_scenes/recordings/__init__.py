"""Posed RGB-D recordings on disk, one reader per format, and a writer of our own."""

from openmap_scenes.recordings.opening import KINDS, kinds_at, open_recording
from openmap_scenes.recordings.own import RecordingWriter
from openmap_scenes.recordings.recording import Frame, Recording, subsampled

__all__ = ["KINDS", "Frame", "Recording", "RecordingWriter", "kinds_at", "open_recording", "subsampled"]
