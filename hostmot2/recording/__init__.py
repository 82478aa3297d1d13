"""Recordings: every cycle in an MCAP file, read back as numpy columns.

Needs the extra `record` (`pip install 'hostmot2[record]'`).
"""

from __future__ import annotations

from hostmot2.recording.errors import (
    BrokenRecording,
    RecordingError,
    RecordingFailed,
    RecordingTooLarge,
)
from hostmot2.recording.file import Attachment
from hostmot2.recording.format import Signal
from hostmot2.recording.recorder import Recorder, RecorderCounters
from hostmot2.recording.recording import Gap, LogEntry, Recording, read

__all__ = [
    "Attachment",
    "BrokenRecording",
    "Gap",
    "LogEntry",
    "Recorder",
    "RecorderCounters",
    "Recording",
    "RecordingError",
    "RecordingFailed",
    "RecordingTooLarge",
    "Signal",
    "read",
]
