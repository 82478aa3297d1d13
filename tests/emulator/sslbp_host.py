"""A host that polls the SSERIAL instance of an emulated board, as the one of the recordings did."""

from __future__ import annotations

from typing import Literal

from hostmot2.emulator import EmulatedBoard, EmulatedRemote

COMMAND, DATA, CS, IF0, IF1, IF2 = 0x5A00, 0x5B00, 0x5C00, 0x5D00, 0x5E00, 0x5F00
STOP_ALL, STOP, START, SETUP, DOIT, READ, WRITE, RESET = (
    0x0800,
    0x0800,
    0x0900,
    0x0F00,
    0x1000,
    0x2000,
    0xA000,
    0x4000,
)
BLOCK, STRIDE = 0x70, 0x32
BETWEEN_COMMANDS_US = 0.45  # the recordings' host took that long to see one end and write the next


class Host:
    def __init__(
        self,
        channels: int = 4,
        processor_clock_hz: int = 100_000_000,
        wire: Literal["on", "off"] = "on",
    ) -> None:
        self.board = EmulatedBoard(
            "5i25+7i77",
            clock="virtual",
            wire=wire,
            sserial_channels=channels,
            processor_clock_hz=processor_clock_hz,
        )
        self.port = self.board.sserial[0]
        for channel in range(channels):
            self.port.detach(channel)
        self.board.advance(400.0)

    def attach(self, channel: int, **what: object) -> EmulatedRemote:
        settings: dict[str, object] = {
            "name": "7I77",
            "unit_number": 0x12345678,
            "receive_size": 9,
            "transmit_size": 6,
            "ptoc": 0x600,
            "gtoc": 0x640,
            "turnaround_us": 6.0,
        } | what
        remote = EmulatedRemote(**settings)  # type: ignore[arg-type]
        remote.inputs = bytes(range(0x11, 0x11 * 9, 0x11))
        self.port.attach(channel, remote)
        return remote

    def read(self, register: int, channel: int = 0) -> int:
        return int(self.board.read(register + 4 * channel))  # type: ignore[arg-type]

    def write(self, register: int, value: int, channel: int = 0) -> None:
        self.board.write(register + 4 * channel, value)

    def begin(self, command: int) -> None:
        self.write(COMMAND, command)

    def finish(self, limit_us: float = 70_000.0) -> float | None:
        """Microseconds until COMMAND reads 0; None: it did not."""
        start = self.board.now_us
        step = 0.05
        while self.read(COMMAND):
            passed = self.board.now_us - start
            if passed > limit_us:
                return None
            step = 0.05 if passed < 300 else 0.5
            self.board.advance(step)
        return self.board.now_us - start

    def command(self, command: int, limit_us: float = 70_000.0) -> float | None:
        self.board.advance(BETWEEN_COMMANDS_US)
        self.begin(command)
        return self.finish(limit_us)

    def result(self, command: int) -> int:
        assert self.command(command) is not None, f"{command:#06x} hangs"
        return self.read(DATA)

    def cs(self, channel: int = 0) -> int:
        return self.read(CS, channel)

    def inputs(self, channel: int = 0) -> tuple[int, int, int]:
        return self.read(IF0, channel), self.read(IF1, channel), self.read(IF2, channel)

    def local(self, address: int, size: int = 1) -> int:
        return sum(self.result(READ | address + i) << 8 * i for i in range(size))

    def write_local(self, address: int, value: int, size: int = 1) -> None:
        for i in range(size):
            self.write(DATA, value >> 8 * i & 0xFF)
            assert self.command(WRITE | address + i) is not None

    def variable(self, offset: int, channel: int = 0, size: int = 1) -> int:
        return self.local(BLOCK + STRIDE * channel + offset, size)

    def access(self, header: int, address: int = 0, value: int = 0, channel: int = 0) -> int:
        """One access in setup mode; returns DATA."""
        self.write(CS, header << 24 | address, channel)
        self.write(IF0, value & 0xFFFFFFFF, channel)
        self.write(IF1, value >> 32, channel)
        return self.result(DOIT | 1 << channel)


def chatters(cs: int) -> int:
    """CS with the phase of the chatter taken out."""
    return cs & 0xFF00FFFF | 0x3A0000 if cs >> 16 & 0xFF == 0x3B else cs
