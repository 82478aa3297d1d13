"""What can be wrong with a recording."""

from __future__ import annotations

from collections.abc import Sequence

from hostmot2.errors import HostMot2Error


class RecordingError(HostMot2Error):
    """A recording could not be written or read."""

    code = "HM2-E110"
    causes: Sequence[str] = ("the recorder was used out of turn, or its source ended",)
    fix = "Read the message; a recording is started once, and closed before it is read."


class BrokenRecording(RecordingError):
    """A file that is no recording of this package, or one cut off before its description was complete."""

    code = "HM2-E111"
    causes = (
        "a file of another program",
        "the recorder was killed before its first second was over",
        "the file was cut off or damaged on its way here",
    )
    fix = "A recording is an MCAP file with the topic /hm2/records, as `hm2 record` writes it."


class RecordingTooLarge(RecordingError):
    """A file that holds more than the reader was told to accept."""

    code = "HM2-E112"
    causes = (
        "a long recording",
        "a damaged file that claims to hold more than it does",
    )
    fix = "Give `read` a larger `limit` if you trust the file."


class RecordingFailed(RecordingError):
    """The writer had to stop (disk full, for instance), or another one has the file.

    What had been written until then is in it.
    """

    code = "HM2-E113"
    causes = (
        "the disk is full",
        "the directory is gone, or may not be written",
        "another recording is being written to the same file",
    )
    fix = "Free space on the disk or record elsewhere; the file reads up to where it ends."
