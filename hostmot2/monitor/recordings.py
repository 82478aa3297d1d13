"""Starting and ending recordings while the engine runs."""

from __future__ import annotations

import os
import time
from itertools import count
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from hostmot2.monitor.snapshot import RecordingView

if TYPE_CHECKING:
    from hostmot2.engine import Engine

JSON_RATE = 100.0


def file_name() -> Path:
    """A name for a recording that begins now, in the working directory, that no file has.

    A second has room for two recordings, and a clock that is put back comes to the same second again.
    """
    stem = time.strftime("hm2-monitor-%Y%m%d-%H%M%S")
    names = (f"{stem}-{number}.mcap" if number > 1 else f"{stem}.mcap" for number in count(1))
    return Path(next(name for name in names if not os.path.lexists(name)))


class Recordings:
    """Recordings of an engine, one after the other. Make it before the engine's start."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._recorder: Any = None
        self._since = 0.0
        self.missing = ""
        """What is not installed, "" if recordings are possible."""
        self._records: Any = None
        package = self._package()
        if package is not None:
            self._records = package.EngineRecords(engine)

    def _package(self) -> ModuleType | None:
        try:
            from hostmot2 import recording
        except ModuleNotFoundError as problem:
            self.missing = f"recordings need {problem.name}: pip install 'hostmot2[record]'"
            return None
        return recording

    @property
    def view(self) -> RecordingView | None:
        """The recording that runs."""
        recorder = self._recorder
        if recorder is None:
            return None
        counters, path = recorder.counters, Path(recorder.path)
        return RecordingView(path, time.monotonic() - self._since, counters.records, counters.dropped)

    def start(self, path: Path) -> None:
        """Record into `path` from now on.

        Raises OSError, ImportError, RecordingError while the last one is still being written.
        """
        if self.missing:
            raise ImportError(self.missing)
        self._recorder = self._records.recorder(path, json_rate=JSON_RATE).start()
        self._since = time.monotonic()

    def stop(self) -> RecordingView | None:
        """End the recording that runs; what it was. Raises RecordingFailed."""
        recorder, self._recorder = self._recorder, None
        if recorder is None:
            return None
        recorder.close()
        counters = recorder.counters
        seconds = time.monotonic() - self._since
        return RecordingView(Path(recorder.path), seconds, counters.records, counters.dropped)

    def log(self, text: str, time_ns: int) -> None:
        """An event, into the recording that runs."""
        recorder = self._recorder  # another thread ends it
        if recorder is not None:
            recorder.log(text, "warning", "engine", time_ns)
