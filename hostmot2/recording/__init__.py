"""Recordings: every cycle in an MCAP file, read back as numpy columns.

Needs the extra `record` (`pip install 'hostmot2[record]'`).
"""

from __future__ import annotations

from hostmot2.recording.attachments import attachments_of, host_metadata
from hostmot2.recording.engine import EngineRecords, record
from hostmot2.recording.errors import (
    BrokenRecording,
    RecordingError,
    RecordingFailed,
    RecordingTooLarge,
)
from hostmot2.recording.export import to_csv, to_parquet
from hostmot2.recording.file import Attachment
from hostmot2.recording.format import Signal
from hostmot2.recording.picture import plot
from hostmot2.recording.pump import RecorderCounters
from hostmot2.recording.recorder import Recorder
from hostmot2.recording.recording import Gap, LogEntry, Recording, read
from hostmot2.recording.replay import Difference, Replay, remote_inputs
from hostmot2.recording.tap import Tap

__all__ = [
    "Attachment",
    "BrokenRecording",
    "Difference",
    "EngineRecords",
    "Gap",
    "LogEntry",
    "Recorder",
    "RecorderCounters",
    "Recording",
    "RecordingError",
    "RecordingFailed",
    "RecordingTooLarge",
    "Replay",
    "Signal",
    "Tap",
    "attachments_of",
    "host_metadata",
    "plot",
    "read",
    "record",
    "remote_inputs",
    "to_csv",
    "to_parquet",
]
