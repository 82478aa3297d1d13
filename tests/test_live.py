"""The live view, looked at by a WebSocket client that is not ours, speaking Foxglove's protocol."""

from __future__ import annotations

import json
import os
import re
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

import hostmot2
from hostmot2 import live, recording
from hostmot2.emulator import EmulatedBoard
from hostmot2.errors import EngineError, LiveError
from hostmot2.live.server import Server
from hostmot2.record_ring import RecordRing, record_dtype
from hostmot2.recording import format as form

SUBPROTOCOL = "foxglove.sdk.v1"
MESSAGE_DATA = 1


class Viewer:
    """What a viewer does: connects, learns the channels, subscribes, receives."""

    def __init__(self, socket: Any) -> None:
        self.socket = socket
        self.info: dict[str, Any] = {}
        self.channels: dict[str, Any] = {}
        self._topics: dict[int, str] = {}
        while not self.channels:
            self._text(self.socket.recv(timeout=10))

    def _text(self, data: Any) -> None:
        message = json.loads(data)
        if message["op"] == "serverInfo":
            self.info = message
        elif message["op"] == "advertise":
            self.channels |= {channel["topic"]: channel for channel in message["channels"]}

    def subscribe(self, *topics: str) -> None:
        subscriptions = []
        for topic in topics:
            number = self.channels[topic]["id"] + 100
            self._topics[number] = topic
            subscriptions.append({"id": number, "channelId": self.channels[topic]["id"]})
        self.socket.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))

    def receive(self, timeout: float = 10.0) -> tuple[str, int, dict[str, Any]]:
        """Topic, time and content of the next message."""
        while True:
            data = self.socket.recv(timeout=timeout)
            if isinstance(data, str):
                self._text(data)
                continue
            operation, number, time_ns = struct.unpack_from("<BIQ", data)
            if operation == MESSAGE_DATA:
                return self._topics[number], time_ns, json.loads(data[13:])

    def until(self, topic: str, wanted: Any) -> dict[str, Any]:
        """The first message of a topic that is as wanted; bounded."""
        end = time.monotonic() + 20
        while time.monotonic() < end:
            found, _, content = self.receive()
            if found == topic and wanted(content):
                return content
        raise AssertionError(f"no such message on {topic}")


Look = Callable[[str], Viewer]


@pytest.fixture
def look_at() -> Iterator[Look]:
    """Opens viewers of a URL and closes them at the end."""
    with ExitStack() as stack:
        yield lambda url: Viewer(
            stack.enter_context(connect(url, subprotocols=[SUBPROTOCOL], close_timeout=0.1))
        )


@pytest.fixture
def emulated() -> EmulatedBoard:
    return EmulatedBoard("5i25+7i77", clock="real")


@pytest.fixture
def engine(emulated: EmulatedBoard) -> Iterator[Any]:
    with hostmot2.open(emulated) as board:
        board.card("7i77").start()
        board.watchdog.timeout = 5.0  # a busy machine is no fault here
        yield board.engine(rate=200, dead_man=0)


def test_channels_schemas_and_units_are_those_of_a_recording(
    engine: Any, emulated: EmulatedBoard, tmp_path: Path, look_at: Look
) -> None:
    with live.serve(engine, port=0) as view:
        seen = look_at(view.url)
        assert seen.info["capabilities"] == []
        assert "5I25" in seen.info["name"]
    with recording.record(engine.board.engine(rate=200), tmp_path / "run.mcap"):
        pass
    with (tmp_path / "run.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
        assert summary
        recorded = {channel.topic: channel for channel in summary.channels.values()}
        assert set(seen.channels) == set(recorded) - {form.RECORDS, form.IMAGE}
        for topic, channel in seen.channels.items():
            schema = summary.schemas[recorded[topic].schema_id]
            assert channel["encoding"] == recorded[topic].message_encoding == "json"
            assert channel["schemaName"] == schema.name
            assert channel["schemaEncoding"] == schema.encoding == "jsonschema"
            assert channel["schema"].encode() == schema.data
            assert channel.get("metadata", {}) == recorded[topic].metadata


def test_messages_have_the_values_of_the_card(engine: Any, emulated: EmulatedBoard, look_at: Look) -> None:
    with live.serve(engine, port=0, json_rate=None) as view, engine:
        seen = look_at(view.url)
        seen.subscribe(form.INPUTS, form.OUTPUTS, form.CYCLE)
        emulated.sserial[0].remote(0).set("input", 0x80A50F01)
        emulated.encoder_input(3).run(edge_period_ns=10_000.0, counts=1234)
        engine.outputs["analogout2"] = 2.5
        engine.write()
        inputs = seen.until(
            form.INPUTS,
            lambda found: found["sserial0_0_Input"] == 0x80A50F01 and found["encoder3_raw_count"] == 1234.0,
        )
        outputs = seen.until(form.OUTPUTS, lambda found: found["sserial0_1_AnalogOut2"] == 2.5)
        cycle = seen.until(form.CYCLE, lambda found: found["status"] == 0)
        for topic, content in ((form.INPUTS, inputs), (form.OUTPUTS, outputs), (form.CYCLE, cycle)):
            schema = json.loads(seen.channels[topic]["schema"])
            assert schema["type"] == "object"
            assert set(content) == set(schema["properties"])
            kinds = {"integer": int, "number": int | float}
            for name, value in content.items():
                assert isinstance(value, kinds[schema["properties"][name]["type"]])
        assert emulated.sserial[0].remote(1).get("analogout2") == pytest.approx(2.5, abs=0.01)


def test_times_are_those_of_the_cycles_and_every_cycle_comes(engine: Any, look_at: Look) -> None:
    with live.serve(engine, port=0, json_rate=None) as view:
        seen = look_at(view.url)
        seen.subscribe(form.CYCLE)
        seen.socket.ping().wait(10)  # the subscription is known now
        before = time.time_ns()
        with engine:
            got = [seen.receive() for _ in range(50)]
    cycles = [content["cycle"] for _, _, content in got]
    assert cycles == list(range(cycles[0], cycles[0] + 50))
    times = [time_ns for _, time_ns, _ in got]
    steps = {later - earlier for earlier, later in pairwise(times)}
    assert all(step % 5_000_000 == 0 and step > 0 for step in steps)
    assert before - 10**9 < times[0] < time.time_ns()


def test_json_rate_thins_messages_out(engine: Any, look_at: Look) -> None:
    with live.serve(engine, port=0, json_rate=20) as view, engine:
        seen = look_at(view.url)
        seen.subscribe(form.INPUTS)
        times = [seen.receive()[1] for _ in range(5)]
    # half a period at least: they are counted from the first one; the first here ends one already begun
    assert all(later - earlier >= 25_000_000 for earlier, later in pairwise(times[1:]))


def test_what_the_program_says_and_the_counters_come_too(engine: Any, look_at: Look) -> None:
    with live.serve(engine, port=0) as view, engine:
        seen = look_at(view.url)
        seen.subscribe(form.LOG, form.RECORDER)
        seen.socket.ping().wait(10)
        view.log("axis 2 stalled", "error", "machine")
        entry = seen.until(form.LOG, lambda found: found["level"] == 4)
        assert (entry["message"], entry["name"]) == ("axis 2 stalled", "machine")
        counted = seen.until(form.RECORDER, lambda found: found["records"] > 0)
        assert counted["dropped"] == 0


def test_nobody_can_write_through_it(engine: Any, emulated: EmulatedBoard, look_at: Look) -> None:
    with live.serve(engine, port=0) as view, engine:
        seen = look_at(view.url)
        channel = {"id": 1, "topic": form.OUTPUTS, "encoding": "json", "schemaName": ""}
        seen.socket.send(json.dumps({"op": "advertise", "channels": [channel]}))
        seen.socket.send(struct.pack("<BI", 1, 1) + b'{"sserial0_1_analogout0": 5}')
        parameter = {"name": "sserial0.1.analogout0", "value": 5}
        seen.socket.send(json.dumps({"op": "setParameters", "parameters": [parameter]}))
        refused = [json.loads(seen.socket.recv(timeout=10)) for _ in range(2)]
        assert [message["op"] for message in refused] == ["status", "status"]
        assert engine.off  # outputs were never written
        assert emulated.sserial[0].remote(1).get("analogout0") == 0.0


class SlowServer(Server):
    """A network that swallows a batch in a second."""

    def plots(self, records: Any) -> None:
        time.sleep(0.2)
        super().plots(records)


def test_a_slow_end_drops_records_counts_them_and_keeps_nobody_waiting(
    monkeypatch: pytest.MonkeyPatch, look_at: Look
) -> None:
    monkeypatch.setattr("hostmot2.live.view.Server", SlowServer)
    ring = RecordRing(record_dtype(), 8)
    with live.LiveView(ring, port=0) as view:
        pushed = 0
        record = np.zeros(1, ring.dtype)
        for cycle in range(100):
            record["cycle"], record["start_ns"] = cycle, cycle * 1_000_000
            pushed += ring.push(record)
        seen = look_at(view.url)
        seen.subscribe(form.RECORDER)
        counted = seen.until(form.RECORDER, lambda found: found["dropped"] > 0)
    assert counted["dropped"] == 100 - pushed == ring.counters.dropped
    assert view.counters.records == pushed


def test_a_viewer_that_does_not_read_disturbs_nobody(engine: Any, look_at: Look) -> None:
    with live.serve(engine, port=0, json_rate=None) as view, engine:
        asleep, awake = look_at(view.url), look_at(view.url)
        asleep.subscribe(form.INPUTS, form.CYCLE)
        awake.subscribe(form.CYCLE)
        first = awake.receive()[2]["cycle"]
        awake.until(form.CYCLE, lambda found: found["cycle"] > first + 200)
        assert view.counters.dropped == 0


def test_an_address_that_cannot_be_had_is_a_typed_error(engine: Any) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        with pytest.raises(live.LiveError, match="in use") as found:
            live.serve(engine, port=taken.getsockname()[1])
        assert found.value.code == "HM2-E114"
    with live.serve(engine, port=0) as view:  # elsewhere, then
        assert view.port


def test_a_view_that_cannot_begin_lets_port_and_records_go(engine: Any) -> None:
    for _ in range(5):  # somebody else may take a free port in between
        with socket.create_server(("127.0.0.1", 0)) as once:
            port = once.getsockname()[1]
        with pytest.raises(ValueError, match="messages per second"):
            live.serve(engine, port=port, json_rate=-1.0)
        with suppress(LiveError), live.serve(engine, port=port) as view:
            assert view.port == port
            return
    pytest.fail("its port was taken, five times")


def test_who_connects_and_says_nothing_does_not_keep_it_open(engine: Any, look_at: Look) -> None:
    """A browser does, to be quick later: the view was never closed then, and its program never ended."""
    with live.serve(engine, port=0) as view:
        silent = [socket.create_connection(("127.0.0.1", view.port)) for _ in range(3)]
        seen = look_at(view.url)
        seen.subscribe(form.CYCLE)
        ending = threading.Thread(target=view.close, daemon=True)
        ending.start()
        ending.join(20)
        assert not ending.is_alive()
        with pytest.raises(ConnectionClosed):
            seen.receive()
    for each in silent:
        each.close()
    with live.LiveView(RecordRing(record_dtype(), 8), port=view.port):
        pass  # there is room for the next


def test_records_go_to_one_reader(engine: Any, tmp_path: Path) -> None:
    with live.serve(engine, port=0), pytest.raises(EngineError, match="already"):
        recording.record(engine, tmp_path / "run.mcap")


def test_hm2_live_says_that_the_port_is_taken() -> None:
    taken = socket.create_server(("127.0.0.1", 0))
    with taken, hm2("live", "--port", str(taken.getsockname()[1])) as process:
        _, err = process.communicate(timeout=60)
    assert process.returncode == 7
    assert "HM2-E114" in err


# -- hm2 live


def hm2(*arguments: str, **options: Any) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "hostmot2", "--board", "emu://5i25+7i77", *arguments]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(command, **pipes, **options)


def test_hm2_live_says_when_it_is_ready_streams_and_ends_with_a_signal(tmp_path: Path, look_at: Look) -> None:
    layout = tmp_path / "layout.json"
    with hm2("live", "--port", "0", "--rate", "200", "--layout", str(layout)) as process:
        assert process.stdout
        word, url = process.stdout.readline().split()
        assert word == "ready"
        assert url.startswith("ws://127.0.0.1:")
        seen = look_at(url)
        seen.subscribe(form.INPUTS)
        names = set(seen.receive()[2])
        process.send_signal(signal.SIGTERM)
        out, err = process.communicate(timeout=30)
    assert process.returncode == 0, err
    assert "cycles" in out
    assert "only programs on this computer can look; nobody can write" in err
    plots = [panel for name, panel in json.loads(layout.read_text())["configById"].items() if "Plot" in name]
    paths = [path["value"] for plot in plots for path in plot["paths"]]
    plotted = {path.rpartition(".")[2] for path in paths if path.startswith(form.INPUTS)}
    assert plotted
    assert plotted <= names


def test_hm2_live_says_who_can_look() -> None:
    with hm2("--json", "live", "--host", "0.0.0.0", "--port", "0", "--seconds", "0.2") as process:
        out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert "everybody who reaches 0.0.0.0 can look; nobody can write" in err
    assert json.loads(out)["dropped"] == 0


def test_without_the_extra_it_says_what_to_install(tmp_path: Path) -> None:
    (tmp_path / "foxglove.py").write_text("raise ModuleNotFoundError('none here', name='foxglove')\n")
    with hm2("live", env=os.environ | {"PYTHONPATH": str(tmp_path)}) as process:
        _, err = process.communicate(timeout=60)
    assert process.returncode == 3
    assert "pip install 'hostmot2[live]'" in err
    assert "Traceback" not in err


def test_the_python_of_the_how_to_runs(capsys: pytest.CaptureFixture[str]) -> None:
    text = (Path(__file__).parents[1] / "docs/how-to/live.md").read_text()
    for block in re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE):
        exec(compile(block, "live.md", "exec"), {})
    assert "ws://127.0.0.1:" in capsys.readouterr().out


def test_hm2_explain_works_without_the_extras(tmp_path: Path) -> None:
    for name in ("foxglove", "msgspec", "mcap", "textual"):
        (tmp_path / f"{name}.py").write_text(f"raise ModuleNotFoundError('none here', name={name!r})\n")
    with hm2("explain", env=os.environ | {"PYTHONPATH": str(tmp_path)}) as process:
        out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert "HM2-E114" in out
