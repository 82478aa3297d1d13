"""hm2 param: parameters by name, through the emulated card and through adapters."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest

import hostmot2
from hostmot2 import lbp
from hostmot2.emulator import EmulatedBoard
from hostmot2.emulator.ftdi import VirtualFtdi, plug, unplug
from hostmot2.fields import Direction, Field, FieldKind
from hostmot2.remotes import backup as backups
from hostmot2.remotes.discovery import RemoteDescription
from hostmot2.remotes.errors import VerifyFailed, WrongBackup
from hostmot2.remotes.parameters import Parameters
from hostmot2.sserial import PortRunning
from wire.lines import connect, emulated, on_pty, tell
from wire.test_parameters import Memory

pytestmark = pytest.mark.timeout(60)
CARD = ("--board", "emu://5i25+7i77?clock=virtual")


def test_list_through_the_card_and_through_an_adapter_is_the_same(hm2) -> None:
    through_card = json.loads(hm2(*CARD, "--json", "param", "list", "0.1")[1])
    through_adapter = json.loads(hm2("--json", "param", "list", "--port", "emu:7i77-analog")[1])
    assert through_card["remote"] == "7I77"
    assert [p["name"] for p in through_card["parameters"]][:3] == [
        "NVBaudRate",
        "NVUnitNumber",
        "NVWatchDogTimeout",
    ]
    assert through_card["parameters"] == through_adapter["parameters"]


def test_list_tells_type_value_unit_and_derived_addresses(hm2) -> None:
    out = hm2("param", "list", "--port", "emu:8i20")[1]
    (line,) = [line for line in out.splitlines() if line.startswith("NVBRAKEONV")]
    assert line.split() == [
        "NVBRAKEONV",
        "UINT",
        "36000",
        "360",
        "V",
        "EEPROM",
        "0..65535",
        "36000",
        "0x0028",
    ]
    assert "0x0828?" in out  # BUSV, derived
    assert "0x08E8 " in out + " "  # MAXCURRENT, confirmed


def test_get_and_set_through_the_card(hm2) -> None:
    assert hm2(*CARD, "param", "get", "0.0", "nvwatchdogtimeout")[1] == "NVWatchDogTimeout = 50  (50 ms)"
    assert hm2(*CARD, "param", "get", "fault", "h")[1] == "Fault = 0001"
    status, out, _ = hm2(*CARD, "param", "set", "-c", "0.1", "NVWATCHDOGTIME", "100")
    assert (status, "was 50" in out, "power cycle" in out) == (0, True, True)
    assert hm2(*CARD, "param", "set", "NVBAUDRATE", "12")[0] == 2
    assert hm2(*CARD, "param", "get", "0.2", "Fault")[0] == 6  # nothing on the expansion channel
    assert hm2(*CARD, "param", "get", "0.9", "Fault")[0] == 2
    assert hm2("param", "set", "QSETPOINT", "-5", "--port", "emu:8i20")[1] == "QSETPOINT = -5, was 0"


def test_refused_while_the_port_runs() -> None:
    with hostmot2.open(EmulatedBoard("5i25+7i77", clock="virtual")) as board:
        channel = board.sserial[0].channels[0]
        board.sserial.start(1)
        with pytest.raises(PortRunning):
            channel.parameters["NVWatchDogTimeout"] = 100
        board.sserial.stop()
        channel.parameters["NVWatchDogTimeout"] = 100


def test_set_save_and_power_cycle(hm2) -> None:
    with on_pty("8i20") as (process, port):
        assert hm2("param", "set", "BRAKEONV", "30000", "--save", "--port", port)[0] == 0
        assert hm2("param", "set", "BRAKEOFFV", "28000", "--port", port)[0] == 0
        assert hm2("param", "set", "KQI", "160000", "--port", port)[0] == 0
        out = hm2("param", "save", "--dry-run", "--port", port)[1]
        assert "would write NVBRAKEOFFV = 28000" in out
        assert "would write NVKQI = 160000" in out
        assert "NVBRAKEONV" not in out
        assert hm2("param", "save", "BRAKEOFFV", "--port", port)[0] == 0
        assert hm2("param", "save", "BUSV", "--port", port)[0] == 2
        assert tell(process, "power-cycle") == "ok"
        values = json.loads(hm2("--json", "param", "get", "BRAKEONV", "BRAKEOFFV", "KQI", "--port", port)[1])
        assert [v["value"] for v in values] == [30000, 28000, 150000]


def test_backup_diff_and_restore(hm2, tmp_path: Path) -> None:
    file = str(tmp_path / "drive.toml")
    with on_pty("8i20") as (process, port):
        assert hm2("param", "backup", file, "--port", port)[0] == 0
        saved = tomllib.loads(Path(file).read_text())
        assert saved["remote"] == {"name": "8I20", "unit_number": 31}
        assert saved["nonvolatile"]["NVBRAKEONV"] == 36000
        assert "# 360 V" in Path(file).read_text()
        assert hm2("param", "diff", file, "--port", port)[:2] == (0, "no difference")
        assert tell(process, "set NVBRAKEONV 190.0") == "ok"
        assert tell(process, "set NVKQP 60") == "ok"
        found = json.loads(hm2("--json", "param", "diff", file, "--port", port)[1])
        assert found == [
            {"name": "NVKQP", "before": 50, "after": 60},
            {"name": "NVBRAKEONV", "before": 36000, "after": 19000},
        ]
        assert "would write NVKQP = 50" in hm2("param", "restore", file, "--dry-run", "--port", port)[1]
        assert tell(process, "get NVKQP") == "NVKQP 60"
        assert hm2("param", "restore", file, "--port", port)[0] == 0
        assert hm2("param", "restore", file, "--port", port)[1] == "nothing differs"
        assert tell(process, "get NVBRAKEONV") == "NVBRAKEONV 360.0"


def test_only_what_differs_is_written(tmp_path: Path) -> None:
    drive = emulated("8i20")
    remote = connect(drive)
    values, found = lbp.parameters(remote), lbp.describe(remote)
    taken = backups.take(found, values)
    drive.set_raw("NVKQP", 51)
    drive.clear_writes()
    for change in backups.planned(taken, found, values):
        values[change.name] = change.after
    assert [(write.address, write.space) for write in drive.writes] == [(10, 1)]
    values["NVKQP"] = 50
    assert drive.write_count == 1  # it held that already


def test_two_files_are_compared(hm2, tmp_path: Path) -> None:
    head = '[remote]\nname = "8I20"\nunit_number = 1\n[nonvolatile]\n'
    (tmp_path / "a.toml").write_text(head + "NVKQP = 50\nNVKDP = 1\n")
    (tmp_path / "b.toml").write_text(head + "nvkqp = 50\nNVKQIL = 2\n")
    status, out, _ = hm2("--json", "param", "diff", str(tmp_path / "a.toml"), str(tmp_path / "b.toml"))
    assert status == 1
    assert json.loads(out) == [
        {"name": "NVKDP", "before": 1, "after": None},
        {"name": "NVKQIL", "before": None, "after": 2},
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("not toml", "no backup"),
        ("[remote]\nname='8I20'\n", "no backup"),
        ("[remote]\nname='7I77'\nunit_number=31\n", "of a 7I77"),
        ("[remote]\nname='8I20'\nunit_number=99\n", "of unit"),
        ("[remote]\nname='8I20'\nunit_number=31\n[nonvolatile]\nNVNIX=1\n", "no NVNIX"),
        ("[remote]\nname='8I20'\nunit_number=31\n[nonvolatile]\nNVKQP=65536\n", "outside"),
        ("[remote]\nname='8I20'\nunit_number=31\n[nonvolatile]\nNVKQP='x'\n", "no number"),
    ],
)
def test_backups_that_do_not_fit_are_refused_whole(tmp_path: Path, text: str, said: str) -> None:
    drive = emulated("8i20")
    remote = connect(drive)
    values, found = lbp.parameters(remote), lbp.describe(remote)
    (tmp_path / "b.toml").write_text(text)
    drive.clear_writes()
    with pytest.raises(WrongBackup, match=said):
        backups.check(backups.read(tmp_path / "b.toml"), found, values, other_unit=False)
    assert drive.write_count == 0


def test_a_unit_number_does_not_move_to_another_unit(tmp_path: Path) -> None:
    card = emulated("7i77-io")
    remote = connect(card)
    values, found = lbp.parameters(remote), lbp.describe(remote)
    other = backups.Backup("7I77", 0x12000099, {"NVUnitNumber": 0x12000099, "NVWatchDogTimeout": 60})
    backups.check(other, found, values, other_unit=True)
    assert [change.name for change in backups.planned(other, found, values)] == ["NVWatchDogTimeout"]


def test_a_cell_that_does_not_keep_its_value_is_reported() -> None:
    drive = emulated("8i20")
    values = lbp.parameters(connect(drive))
    with pytest.raises(VerifyFailed) as failure:
        values["FAULT"] = 0
    assert (failure.value.expected, failure.value.received) == (0, 1)


def test_adapters_are_listed(hm2) -> None:
    plug(VirtualFtdi(emulated("8i20")))
    try:
        found = json.loads(hm2("--json", "discover", "--serial")[1])
        assert "ftdi://0x0403:0x6001:HM2EMU/1" in [adapter["port"] for adapter in found]
        assert hm2("param", "get", "BUSV", "--port", "ftdi:///1")[1] == "BUSV = 32000  (320 V)"
    finally:
        unplug()


def test_a_cell_that_holds_what_it_may_not_is_kept_and_keeps_no_other_from_being_restored() -> None:
    """An erased EEPROM cell: 0xFFFF is no baud rate, and no FLOAT."""
    memory = Memory()
    fields = [
        Field("NVBaudRate", FieldKind.NONVOL_UNSIGNED, 16, Direction.BIDIRECTIONAL, 0, 11, "", 0x10),
        Field("NVGain", FieldKind.NONVOL_FLOAT, 32, Direction.BIDIRECTIONAL, 0, 1, "", 0x20),
        Field("NVTime", FieldKind.NONVOL_UNSIGNED, 16, Direction.BIDIRECTIONAL, 0, 100, "", 0x30),
    ]
    memory.spaces[1][:] = b"\xff" * 0x30 + b"\x32" + bytes(0xCF)
    values = Parameters(memory, fields)
    found = RemoteDescription("7I77", 1, parameters=tuple(fields))
    taken = backups.take(found, values)
    assert backups.differences(taken.values, {name: values[name] for name in values}) == []
    memory.spaces[1][0x30] = 0x40
    backups.check(taken, found, values, other_unit=False)
    assert [(c.name, c.after) for c in backups.planned(taken, found, values)] == [("NVTime", 0x32)]
    memory.spaces[1][0x10] = 9
    with pytest.raises(WrongBackup, match="65535 is outside"):
        backups.check(taken, found, values, other_unit=False)
