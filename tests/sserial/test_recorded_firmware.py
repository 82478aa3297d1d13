"""The C port judged by what the published firmware answered, not by our emulator."""

import pytest

from hostmot2._core import ffi, lib

from .recorded import CPort, Recorded, Step, is_local_read

DOIT, STOP, START, SETUP = 0x1000, 0x0800, 0x0900, 0x0F00


def inputs(port: CPort, channel: int) -> tuple[int, ...]:
    return tuple(port.image.inputs[channel][n] for n in range(3))


def set_outputs(port: CPort, step: Step) -> None:
    for (row, channel), value in step.writes.items():
        if row.startswith("if"):
            port.image.outputs[channel][int(row[2])] = value


def recorded_inputs(step: Step, channel: int) -> dict[int, int]:
    return {int(row[2]): v for (row, ch), v in step.reads.items() if ch == channel and row.startswith("if")}


class Walk:
    """Asks the driver for what was recorded, step by step, and compares what it reports."""

    def __init__(self, name: str, channels: int = 4) -> None:
        self.recorded = Recorded(name)
        self.port = CPort(self.recorded, channels)
        self.started = 0
        self.setup = False
        self.compared = 0

    def run(self, stop_before: int | None = None) -> None:
        for index, step in enumerate(self.recorded.steps[:stop_before]):
            self.recorded.expect(index)
            self.step(step)
            assert self.recorded.faults == []

    def step(self, step: Step) -> None:
        kind, mask = step.command & 0xFF00, step.command & 0xFF
        if step.command == STOP:
            assert self.port.call("stop", 0) == 0
            self.started = 0
        elif kind == STOP:
            assert self.port.call("stop", mask) == 0
            self.started &= ~mask
        elif kind in (START, SETUP) and not mask & self.started:
            self.start(step, kind == SETUP, mask)
        elif kind == DOIT and self.setup:
            self.access(step, mask)
        elif kind == DOIT and mask & self.started == mask:
            self.doit(step, mask)
        elif is_local_read(step.command):
            self.read_local(step)

    def start(self, step: Step, setup: bool, mask: int) -> None:
        mode = lib.HM2_SSERIAL_SETUP if setup else lib.HM2_SSERIAL_NORMAL
        failed = self.port.call("start", mask, mode)
        assert failed == (step.data or 0) & mask
        self.started |= mask & ~failed
        self.setup = setup
        facts = ffi.new("hm2_sserial_identity *")
        for channel in range(4):
            lib.hm2_sserial_get_identity(self.port.handle, channel, facts)
            found = {"cs": facts.cs, "if0": facts.unit_number, "if1": facts.name, "if2": facts.toc}
            for (row, ch), value in step.reads.items():
                if ch == channel and mask >> channel & 1:
                    assert found[row] == value
                    self.compared += 1

    def doit(self, step: Step, mask: int) -> None:
        set_outputs(self.port, step)
        before = {c: inputs(self.port, c) for c in range(4)}
        failed = self.port.call("doit", mask) & 0xFF
        assert failed == (step.data or 0) & mask
        for channel in range(4):
            if failed >> channel & 1:
                assert inputs(self.port, channel) == before[channel]
            elif mask >> channel & 1:
                for register, value in recorded_inputs(step, channel).items():
                    assert inputs(self.port, channel)[register] == value
                    self.compared += 1
            if mask >> channel & 1 and ("cs", channel) in step.reads:
                assert self.port.image.cs[channel] == step.reads["cs", channel]

    def access(self, step: Step, mask: int) -> None:
        """One channel's pass-through access; the recording names its command in the CS written before."""
        if mask not in (1, 2, 4, 8) or ("cs", mask.bit_length() - 1) not in step.writes:
            return
        channel = mask.bit_length() - 1
        word = step.writes["cs", channel]
        command, address = word >> 24, word & 0xFFFF
        if command & 0x40 == 0:
            return  # nothing that is sent
        data = [step.writes.get((row, channel), 0) for row in ("if0", "if1")]
        value = ffi.new("uint64_t *", data[0] | data[1] << 32)
        status = self.port.call("access", channel, command, address, value)
        assert status == (lib.HM2_ERR_TIMEOUT if (step.data or 0) & mask else lib.HM2_OK)
        if status == lib.HM2_OK and not command & 0x20 and ("if0", channel) in step.reads:
            assert value[0] & 0xFFFFFFFF == step.reads["if0", channel]
            assert value[0] >> 32 == step.reads.get(("if1", channel), value[0] >> 32)
            self.compared += 1

    def read_local(self, step: Step) -> None:
        byte = ffi.new("uint8_t *")
        status = lib.hm2_sserial_read_local(self.port.handle, step.command & 0xFFF, byte, 1, self.port.error)
        assert status == lib.HM2_OK
        if step.data is not None:
            assert byte[0] == step.data
            self.compared += 1


@pytest.mark.parametrize(
    "name",
    ["c_start_present_absent", "d_doit_data", "f_setup", "i_remote_fault", "s1_8i20_run", "w1_counters"],
)
def test_every_recorded_answer_is_reported_as_it_was(name):
    walk = Walk(name)
    walk.run()
    assert walk.compared > 10


def test_bring_up_of_a_7i77_as_recorded():
    recorded = Recorded("y5_7i77_bringup")
    port = CPort(recorded, channels=3)
    assert port.call("reset") == lib.HM2_OK
    assert recorded.commands[:3] == [0x4000, 0x0001, 0x2003]
    walk = Walk("y5_7i77_bringup", channels=3)
    first_stop = next(i for i, step in enumerate(recorded.steps) if step.command == STOP)
    for index in range(first_stop, len(recorded.steps)):
        walk.recorded.expect(index)
        walk.step(walk.recorded.steps[index])
        assert walk.recorded.faults == []
    assert inputs(walk.port, 0)[0] == 0xA4A3A2A1
    assert walk.compared > 20


def test_a_stop_sends_zeroes_first():
    walk = Walk("i_remote_fault")
    walk.run()
    assert walk.recorded.extra_doits
    for outputs in walk.recorded.extra_doits:
        assert set(outputs.values()) == {0}


def test_each_new_remote_fault_is_reported_once_and_again_when_it_comes_back():
    walk = Walk("i_remote_fault")
    seen = []
    for index, step in enumerate(walk.recorded.steps):
        walk.recorded.expect(index)
        walk.step(step)
        if step.command & 0xFF00 == DOIT:
            seen += [(step.reads.get(("cs", 0)), rising) for _, _, _, rising in walk.port.events()]
        else:
            walk.port.events()
        if len(seen) == 3:
            break
    # fault 01 brings the sticky bits with it; 20 replaces it; after 00, 01 comes back
    assert seen == [(0x01422140, 0x01002140), (0x20422140, 0x20000000), (0x01422140, 0x01000000)]


def test_lost_replies_are_one_fault_until_a_transfer_works_again():
    walk = Walk("w1_counters")
    reported = []
    for index, step in enumerate(walk.recorded.steps):
        walk.recorded.expect(index)
        walk.step(step)
        events = walk.port.events()
        if step.command & 0xFF00 == DOIT:
            reported.append((bool((step.data or 0) & 1), [rising & 0xFF for _, _, _, rising in events]))
    failures = [rising for failed, rising in reported if failed]
    # 3 CRC errors, 3 + 25 lost replies, 3 surplus bytes, 3 breaks: the DATA bit of each was seen
    assert len(failures) >= 3 + 3 + 3 + 3 + 25
    new = [local for failed, rising in reported for local in rising]
    # each kind appears once after each stop, TooManyErrors with the 21st loss, RemoteFault at the end
    for bit in (0x01, 0x08, 0x10, 0x20, 0x40, 0x80):
        assert any(local & bit for local in new)


def test_no_bus_access_is_wasted_in_a_7i77_cycle():
    recorded = Recorded("y5_7i77_bringup")
    port = CPort(recorded, channels=3)
    start = next(i for i, s in enumerate(recorded.steps) if s.command == 0x0903)
    recorded.expect(start)
    assert port.call("start", 3, lib.HM2_SSERIAL_NORMAL) == 0
    # field I/O mode 0: 32 in, 16 out; analog: 80 out
    assert lib.hm2_sserial_set_bits(port.handle, 0, 32, 16, port.error) == lib.HM2_OK
    assert lib.hm2_sserial_set_bits(port.handle, 1, 0, 80, port.error) == lib.HM2_OK
    set_outputs(port, recorded.steps[start + 1])
    costs = []
    for index in range(start + 1, len(recorded.steps)):
        recorded.expect(index)
        before = port.board_counters()
        assert port.call("doit", 3) == 0
        costs.append(tuple(b - a for a, b in zip(before, port.board_counters(), strict=True)))
    assert recorded.faults == []
    # once the duration is known: outputs and DOIT, a look at COMMAND or two, the results
    exchanges, reads, writes = costs[-1]
    assert exchanges <= 4
    # DATA, CS 0, CS 1, inputs of channel 0, and COMMAND with each look
    assert reads == 4 + exchanges - 2
    assert writes == 5  # one word of channel 0, three of channel 1, DOIT


def test_the_pipeline_takes_one_exchange_a_cycle_when_the_doit_must_be_over():
    recorded = Recorded("y5_7i77_bringup")
    port = CPort(recorded, channels=3)
    start = next(i for i, s in enumerate(recorded.steps) if s.command == 0x0903)
    recorded.expect(start)
    assert port.call("start", 3, lib.HM2_SSERIAL_NORMAL) == 0
    assert lib.hm2_sserial_set_bits(port.handle, 0, 32, 16, port.error) == lib.HM2_OK
    assert lib.hm2_sserial_set_bits(port.handle, 1, 0, 80, port.error) == lib.HM2_OK
    set_outputs(port, recorded.steps[start + 1])
    requested = ffi.new("uint32_t *")
    recorded.expect(start + 1)
    seen = []
    for _ in range(4):
        before = port.board_counters()
        assert port.call("cycle", 3, requested) == 0
        cost = tuple(b - a for a, b in zip(before, port.board_counters(), strict=True))
        seen.append((requested[0], cost))
        recorded.now_ns += 1_000_000
    assert seen == [(0, (1, 0, 5)), (3, (1, 5, 5)), (3, (1, 5, 5)), (3, (1, 5, 5))]
    # the fourth DOIT's result is not lost when something else is asked of the port
    assert lib.hm2_sserial_read_local(port.handle, 3, ffi.new("uint8_t *"), 1, port.error) == lib.HM2_OK
    assert inputs(port, 0)[0] == 0xA4A3A2A1
    assert recorded.faults == []


def test_the_pipeline_writes_nothing_while_the_last_doit_is_at_work():
    recorded = Recorded("y5_7i77_bringup")
    port = CPort(recorded, channels=3)
    start = next(i for i, s in enumerate(recorded.steps) if s.command == 0x0903)
    recorded.expect(start)
    assert port.call("start", 3, lib.HM2_SSERIAL_NORMAL) == 0
    requested = ffi.new("uint32_t *")
    set_outputs(port, recorded.steps[start + 1])
    assert port.call("cycle", 3, requested) == 0
    writes = len([a for a in recorded.accesses if a[0] == "w"])
    assert port.call("cycle", 3, requested) == lib.HM2_ERR_BUSY
    assert port.error.detail == lib.HM2_SSERIAL_TOO_SOON
    assert len([a for a in recorded.accesses if a[0] == "w"]) == writes
    recorded.now_ns += 200_000
    assert port.call("cycle", 3, requested) == 0
    assert requested[0] == 3
    assert recorded.faults == []
