"""The WebSocket server: the one file that knows foxglove-sdk."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any

import foxglove
import numpy as np
import numpy.typing as npt

from hostmot2.errors import LiveError
from hostmot2.recording import format as form
from hostmot2.recording.format import Signal
from hostmot2.recording.topics import Message, Messages, topics

STOP_SECONDS = 2.0
LEFT_OUT = (form.IMAGE,)
"""Belongs to the binary records, which are for files."""


class Server:
    """Topics and messages on their way to viewers; a `Sink` of the pump. No client can write anything.

    Raises LiveError if host and port cannot be had.
    """

    def __init__(
        self,
        host: str,
        port: int,
        name: str,
        inputs: Sequence[Signal],
        outputs: Sequence[Signal],
        unix_ns: int,
    ) -> None:
        self._messages = Messages(inputs, outputs, unix_ns)
        context = self._context = foxglove.Context()  # without it its channels are closed
        self._channels = {
            topic.name: foxglove.Channel(
                topic.name,
                schema=foxglove.Schema(name=topic.schema_name, encoding="jsonschema", data=topic.schema),
                message_encoding="json",
                metadata=topic.units,
                context=context,
            )
            for topic in topics(inputs, outputs)
            if topic.name not in LEFT_OUT
        }
        try:
            self._server = foxglove.start_server(
                name=name, host=host, port=port, context=context, capabilities=[]
            )
        except RuntimeError as problem:
            raise LiveError(f"{host}:{port}: {problem}") from problem
        self.port = int(self._server.port)
        """The one that was taken, if 0 was asked for."""

    def records(self, records: npt.NDArray[np.void]) -> None:
        """Binary records are for files."""
        self._messages.passed(records)

    def plots(self, records: npt.NDArray[Any]) -> None:
        """A message per record and topic."""
        for message in self._messages.plots(records):
            self._send(message)

    def image(self, registers: Sequence[int]) -> None:
        """Belongs to the binary records."""

    def counters(self, records: int, dropped: int) -> None:
        """How many records were taken and dropped."""
        self._send(self._messages.counters(records, dropped))

    def log(self, board_ns: int, level: str, name: str, message: str) -> None:
        """A line for the log panel."""
        self._send(self._messages.log(board_ns, level, name, message))

    def _send(self, message: Message) -> None:
        self._channels[message.topic].log(message.data, log_time=message.time_ns)

    def flush(self) -> None:
        """Messages do not wait."""

    def finish(self) -> None:
        """Viewers are not told; they see the connection end."""

    def close(self) -> None:
        """End all connections.

        The server waits for those that have not yet said what they want, for ever if need be; a daemon thread
        does that, and this program goes on.
        """
        stopping = threading.Thread(target=self._server.stop, name="hm2 live ends", daemon=True)
        stopping.start()
        stopping.join(STOP_SECONDS)
