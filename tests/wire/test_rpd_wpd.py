"""hm2 rpd and wpd as the manuals use them, on emulated remotes behind pseudo terminals."""

from __future__ import annotations

import json
import os
import signal
import time
from pathlib import Path

import pytest
from lbp import crc8

from wire.lines import on_pty, tell

pytestmark = pytest.mark.timeout(60)


def test_the_8i20_manuals_examples(hm2, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """8I20 manual, "DRIVE PARAMETER SETUP", with its environment variables."""
    state = tmp_path / "drive"
    with on_pty("8i20", "--state", str(state)) as (process, port):
        for name, value in (("COMPORT", port), ("BAUDRATE", "115200"), ("PROTOCOL", "LBP")):
            monkeypatch.setenv(name, value)
        assert hm2("wpd", "BRAKEONV", "30000")[:2] == (0, "BRAKEONV = 30000  (300 V), was 36000")
        status, out, _ = hm2("wpd", "NVBRAKEONV", "32000")
        assert status == 0
        assert "320 V" in out
        assert "after a power cycle" in out
        assert hm2("rpd", "BRAKEONV")[1] == "BRAKEONV = 30000  (300 V)"
        assert hm2("rpd", "FAULT", "H")[1] == "FAULT = 0001  (watchdog bitten)"
        assert hm2("rpd", "BUSV")[1] == "BUSV = 32000  (320 V)"
        assert "was 750" in hm2("wpd", "NVMAXCURRENT", "2500")[1]
        assert hm2("rpd", "MAXCURRENT")[1] == "MAXCURRENT = 750  (7.5 A)"
        assert tell(process, "power-cycle") == "ok"
        assert hm2("rpd", "maxcurrent")[1] == "MAXCURRENT = 2500  (25 A)"
        assert hm2("rpd", "brakeonv")[1] == "BRAKEONV = 32000  (320 V)"
        assert hm2("wpd", "NVBRAKEONV", "19000")[0] == 0
        assert hm2("wpd", "NVBRAKEOFFV", "17000")[0] == 0
    with on_pty("8i20", "--state", str(state)) as (_, port):  # the EEPROM has outlived the power
        monkeypatch.setenv("COMPORT", port)
        assert hm2("rpd", "BRAKEOFFV")[1] == "BRAKEOFFV = 17000  (170 V)"


def test_wpd_fault_0_does_not_clear_a_fault_and_says_so(hm2) -> None:
    """8I20 manual: "faults can not be cleared by writing the fault register"."""
    status, _, err = hm2("wpd", "FAULT", "0", "-p", "emu:8i20")
    assert status == 6
    assert "reads 1" in err
    assert hm2("wpd", "CLEARFAULT", "FFFF", "H", "-p", "emu:8i20")[0] == 0


def test_the_7i77_manuals_examples(hm2, monkeypatch: pytest.MonkeyPatch) -> None:
    """7I77 manual, "RPD, WPD, AND UFLBP"."""
    with on_pty("7i77-io") as (process, port):
        settings = {"BAUDRATE": "115200", "BAUDRATEMUL": "1", "PROTOCOL": "LBP", "INTERFACE": "OSDEVICE"}
        for name, value in (settings | {"COMPORT": port}).items():
            monkeypatch.setenv(name, value)
        status, out, _ = hm2("wpd", "NVWATCHDOGTIME", "100")
        assert (status, "100 ms" in out, "power cycle" in out) == (0, True, True)
        assert tell(process, "get NVWatchDogTimeout") == "NVWatchDogTimeout 100"
        assert "already" in hm2("wpd", "NVWATCHDOGTIMEOUT", "100")[1]
        assert hm2("rpd", "FAULT", "H")[1] == "Fault = 0001"
        assert hm2("wpd", "WATCHDOGTIME", "0")[0] == 0
        assert hm2("rpd", "watchdogtime")[1] == "WatchDogTime = 0  (0 ms)"
        status, _, err = hm2("wpd", "OUTPUT", "AAAAAAAAAAAA", "H")
        assert status == 2
        assert "16 bits" in err  # the 7I77 has 16 outputs
        assert hm2("wpd", "OUTPUT", "AAAA", "H")[1] == "Output = AAAA, was 0000"


def test_48_outputs_are_written_at_once(hm2) -> None:
    """`WPD OUTPUT AAAAAAAAAAAA H` on a card that has them, the 7I69."""
    status, out, _ = hm2("wpd", "OUTPUT", "AAAAAAAAAAAA", "H", "--port", "emu:7i69")
    assert (status, out) == (0, "Output = AAAAAAAAAAAA, was 000000000000")


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (("wpd", "NVMAXCURRENT", "65536"), 2, "outside 0..65535"),
        (("wpd", "NVMAXCURRENT", "-1"), 2, "outside 0..65535"),
        (("wpd", "QSETPOINT", "-32769"), 2, "outside -32768..32767"),
        (("wpd", "NVBAUDRATE", "12"), 2, "outside 0..11"),
        (("wpd", "NVMAXCURRENT", "2.5"), 2, "whole numbers"),
        (("wpd", "NVMAXCURRENT", "12345", "H"), 2, "16 bits"),
        (("wpd", "NVMAXCURRENT", "2500", "X"), 2, "X"),
        (("rpd", "NVMAXCURENT"), 2, "did you mean NVMAXCURRENT"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_written(hm2, arguments, status, said) -> None:
    result, _, err = hm2(*arguments, "--port", "emu:8i20")
    assert (result, said in err) == (status, True)


def test_negative_values_and_their_hexadecimal(hm2) -> None:
    assert hm2("wpd", "QSETPOINT", "-2", "-p", "emu:8i20")[1] == "QSETPOINT = -2, was 0"
    assert hm2("wpd", "QSETPOINT", "fffe", "h", "-p", "emu:8i20")[1] == "QSETPOINT = FFFE, was 0000"


def test_dry_run_writes_nothing(hm2) -> None:
    with on_pty("8i20") as (process, port):
        assert "would write" in hm2("wpd", "NVMAXCURRENT", "2500", "--dry-run", "-p", port)[1]
        assert tell(process, "get NVMAXCURRENT") == "NVMAXCURRENT 7.5"


def test_json(hm2) -> None:
    facts = json.loads(hm2("--json", "rpd", "NVBRAKEONV", "-p", "emu:8i20")[1])
    assert (facts["value"], facts["hex"], facts["scaled"], facts["unit"]) == (36000, "8CA0", 360.0, "V")
    assert (facts["nonvolatile"], facts["default"], facts["address_derived"]) == (True, 36000, False)
    facts = json.loads(hm2("wpd", "BRAKEONV", "1", "-p", "emu:8i20", "--json")[1])
    assert (facts["before"], facts["written"], facts["address_derived"]) == (36000, True, True)


@pytest.mark.parametrize(
    ("name", "value"),
    [("PROTOCOL", "LBP16"), ("INTERFACE", "DIRECT"), ("BAUDRATE", "fast"), ("COMPORT", "")],
)
def test_an_environment_that_cannot_be_met_is_a_usage_error(hm2, monkeypatch, name: str, value: str) -> None:
    monkeypatch.setenv("COMPORT", "/dev/null")
    monkeypatch.setenv(name, value)
    status, _, err = hm2("rpd", "BUSV")
    assert status == 2
    assert name in err


def test_exit_codes_of_ports(hm2, tmp_path: Path) -> None:
    assert hm2("rpd", "BUSV", "-p", str(tmp_path / "no-such-port"))[0] == 3
    assert hm2("rpd", "BUSV", "-p", "ftdi:///1")[0] == 3
    with on_pty("8i20") as (_, port):
        assert hm2("rpd", "BUSV", "-p", port, "--baud", "9600")[0] == 5  # not heard
        assert hm2("rpd", "BUSV", "-p", port)[0] == 0


def test_a_port_in_use_is_busy(hm2) -> None:
    from hostmot2 import lbp

    with on_pty("8i20") as (_, port), lbp.open(port):
        assert hm2("rpd", "BUSV", "-p", port)[0] == 7


def test_an_old_8i20_with_its_crc_off(hm2) -> None:
    with on_pty("8i20", "--crc-off") as (_, port):
        assert hm2("wpd", "NVMAXCURRENT", "2500", "-p", port)[0] == 0
        assert hm2("rpd", "NVMAXCURRENT", "-p", port)[1] == "NVMAXCURRENT = 2500  (25 A)"


def test_the_baud_index_counts_in_operate_mode(hm2) -> None:
    """8I20 manual, "OPERATE MODE BAUD RATE"; the set-up jumper rescues from a wrong one."""
    with on_pty("8i20") as (process, port):
        assert "57600 baud" in hm2("wpd", "NVBAUDRATE", "3", "-p", port)[1]
        assert tell(process, "operate") == "ok"
        assert hm2("rpd", "BUSV", "-p", port)[0] == 5
        assert hm2("rpd", "BUSV", "-p", port, "--baud", "57600")[0] == 0
        assert tell(process, "setup") == "ok"
        assert hm2("rpd", "BUSV", "-p", port)[0] == 0


def test_a_signal_cycles_the_power_and_another_ends_with_status_0(hm2) -> None:
    with on_pty("8i20") as (process, port):
        assert hm2("wpd", "BRAKEONV", "1", "-p", port)[0] == 0
        os.kill(process.pid, signal.SIGUSR1)
        time.sleep(0.3)  # it looks for signals ten times a second
        assert hm2("rpd", "BRAKEONV", "-p", port)[1].startswith("BRAKEONV = 36000")
        assert tell(process, "nonsense").startswith("error")
        assert tell(process, "set BUSV 160.0") == "ok"
        assert hm2("rpd", "BUSV", "-p", port)[1] == "BUSV = 16000  (160 V)"
    assert process.returncode == 0


def test_a_state_of_another_remote_is_refused(hm2, tmp_path: Path) -> None:
    state = tmp_path / "state"
    with on_pty("8i20", "--state", str(state)):
        pass
    status, _, err = hm2("emulate-remote", "7i64", "--pty", "--state", str(state))
    assert (status, "is the state of a 8i20, not of a 7i64" in err) == (2, True), err
    state.write_text("{}")
    assert hm2("emulate-remote", "8i20", "--pty", "--state", str(state))[0] == 2


def test_raw_frames_on_the_terminal_and_the_gap_timer() -> None:
    """lbp_serial.md 2 and 4: a frame cut by more than 25.5 characters of silence is dropped unanswered."""
    import serial

    with on_pty("8i20") as (_, port), serial.Serial(port, 115200, timeout=2) as line:

        def ask(*parts: str, pause_s: float = 0.0, answer: int = 2, timeout: float = 2.0) -> str:
            line.timeout = timeout
            for part in parts:
                line.write(bytes.fromhex(part))
                time.sleep(pause_s)
            return line.read(answer).hex(" ").upper()

        assert ask("DF 16") == "5A A5"
        assert ask("D1 09") == "49 DA"  # the "I" of 8I20
        assert ask("EC 01 66", answer=1) == "00"
        assert ask("45 02 00 95", answer=3) == "EE 02 " + f"{crc8(bytes([0xEE, 0x02])):02X}"  # 750
        assert ask("EC 00 38", answer=1) == "00"
        assert ask("DF", "16", pause_s=0.05, timeout=0.2) == ""
        assert ask("DF 16") == "5A A5"  # heard again
        assert ask("DF 17", timeout=0.2) == ""  # wrong CRC: silence
        time.sleep(0.01)
        assert ask("C1 94")[:2] != "00"  # and a bit in the status


def test_a_slow_line(hm2) -> None:
    with on_pty("8i20") as (process, port):
        assert hm2("wpd", "NVBAUDRATE", "0", "-p", port)[0] == 0
        assert tell(process, "operate") == "ok"
        assert hm2("rpd", "NVBAUDRATE", "-p", port, "--baud", "9600")[1] == "NVBAUDRATE = 0  (9600 baud)"


def test_a_remote_on_a_terminal_does_as_it_is_told_and_survives_what_cannot_be(hm2) -> None:
    with on_pty("7i77-io", "--crc-off") as (process, port):
        assert hm2("rpd", "NVWATCHDOGTIMEOUT", "-p", port)[:2] == (0, "NVWatchDogTimeout = 50  (50 ms)")
        assert tell(process, "crc on") == "ok"
        assert hm2("rpd", "NVWATCHDOGTIMEOUT", "-p", port)[0] == 0
        assert tell(process, "set input 1e999.").startswith("error")
        assert tell(process, "quit") == "ok"
        assert process.wait(timeout=20) == 0


def test_where_a_remote_is_to_be_must_be_said(hm2) -> None:
    status, _, err = hm2("emulate-remote", "8i20")
    assert (status, "--pty" in err) == (2, True)


def test_a_dry_run_says_what_a_run_would_do(hm2) -> None:
    """An EEPROM cell that holds the value already is not written."""
    for more in ((), ("--dry-run",)):
        status, out, _ = hm2("wpd", "NVKQP", "50", *more, "-p", "emu:8i20")
        assert (status, out) == (0, "NVKQP = 50 already; EEPROM not rewritten")
