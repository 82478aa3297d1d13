"""The emulated remote answers every recorded frame as the recorded stand-in did: bytes, order and time."""

import pytest
from stand_in import GOLDEN, lines, stand_in, steer

from hostmot2._core import ffi, lib
from hostmot2.emulator import EmulatedRemote

RECORDINGS = sorted(path.stem for path in (GOLDEN / "wire").glob("*.jsonl"))
PS = 1_000_000
BIT_PS = 400_000
FIRMWARE_PITCH_PS = 4_030_000


class Line:
    """A host that sends bytes at given times and writes down what comes back."""

    def __init__(self, remote: EmulatedRemote) -> None:
        self.remote = remote
        self.byte = ffi.new("hm2_line_byte *")

    def send(self, start_ps: int, value: int, framing_error: int = 0) -> None:
        self.byte[0] = {
            "start_ps": start_ps,
            "bit_ps": BIT_PS,
            "value": value,
            "framing_error": framing_error,
        }
        lib.hm2_remote_line_receive(self.remote.handle, self.byte)

    def send_frame(self, start_ps: int, frame: bytes, pitch_ps: int = FIRMWARE_PITCH_PS) -> int:
        """Returns the middle of the last stop bit."""
        for index, value in enumerate(frame):
            self.send(start_ps + index * pitch_ps, value)
        return start_ps + (len(frame) - 1) * pitch_ps + 19 * BIT_PS // 2

    def heard(self) -> list[tuple[int, int, int]]:
        """Start time, value and framing error of every byte sent so far."""
        out = []
        while lib.hm2_remote_line_peek(self.remote.handle, self.byte):
            out.append((self.byte.start_ps, self.byte.value, self.byte.framing_error))
            lib.hm2_remote_line_pop(self.remote.handle)
        return out


def replay(recording: str, channel: int) -> tuple[list[object], list[object]]:
    settings = [
        e for e in lines(GOLDEN / f"{recording}.jsonl") if e["op"] == "set" and e.get("ch") == channel
    ]
    frames = [e for e in lines(GOLDEN / "wire" / f"{recording}.jsonl") if e["ch"] == channel]
    first = {e["knob"]: e["value"] for e in settings if e["t_us"] < 1}
    later = [e for e in settings if e["t_us"] >= 1]
    remote = stand_in(recording, channel, first)
    line = Line(remote)
    expected, seen = [], []
    for frame in frames:
        data = bytes.fromhex(frame["hex"])
        if frame["dir"] == "remote->fw":
            expected.append((frame["t_us"], data.hex(" "), bool(frame.get("break"))))
            continue
        while later and later[0]["t_us"] <= frame["t_us"]:
            change = later.pop(0)
            steer(remote, change["knob"], change["value"])
        line.send_frame(round(frame["t_us"] * PS), data)
        answer = line.heard()
        if answer:
            seen.append(
                (
                    answer[0][0] / PS,
                    bytes(value for _, value, _ in answer).hex(" "),
                    any(broken for _, _, broken in answer),
                )
            )
            assert [start - answer[0][0] for start, _, _ in answer] == [
                4 * PS * index for index in range(len(answer))
            ]
    return expected, seen


@pytest.mark.parametrize("channel", [0, 1, 2])
@pytest.mark.parametrize("recording", RECORDINGS)
def test_every_recorded_frame_gets_the_recorded_answer(recording: str, channel: int) -> None:
    settings = lines(GOLDEN / f"{recording}.jsonl")
    if not any(e["op"] == "set" and e.get("ch") == channel for e in settings):
        pytest.skip("idle line")
    expected, seen = replay(recording, channel)
    assert [answer[1:] for answer in seen] == [answer[1:] for answer in expected]
    for (time, *_), (wanted, *_) in zip(seen, expected, strict=True):
        assert abs(time - wanted) < 0.02
