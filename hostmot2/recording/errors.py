"""What can be wrong with a recording."""

from __future__ import annotations

from hostmot2.errors import HostMot2Error


class RecordingError(HostMot2Error):
    """A recording could not be written or read."""

    code = "HM2-E110"


class BrokenRecording(RecordingError):
    """A file that is no recording of this package, or one cut off before its description was complete."""

    code = "HM2-E111"
    fix = "A recording is an MCAP file with the topic /hm2/records, as `hm2 record` writes it."


class RecordingTooLarge(RecordingError):
    """A file that holds more than the reader was told to accept."""

    code = "HM2-E112"
    fix = "Give `read` a larger `limit` if you trust the file."


class RecordingFailed(RecordingError):
    """The writer had to stop (disk full, for instance); what had been written until then is in the file."""

    code = "HM2-E113"
    fix = "Free space on the disk or record elsewhere; the file reads up to where it ends."
