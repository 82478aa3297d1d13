"""mesaflash on the emulated card: it finds all there is, and what it prints is what our driver reports."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import pytest
from bitfile_samples import payload, xilinx
from machine import CARD_IP, MAC, ServedCard, blocks, run


def number(text: str, label: str, base: int = 10) -> int:
    match = re.search(rf"{label}:?\s+(?:are )?(?:0x)?([0-9A-Fa-f]+)", text)
    assert match, f"no {label} in {text!r}"
    return int(match[1], base)


def test_the_card_is_found(card: ServedCard):
    assert f"ETH device 7I92 at ip={CARD_IP}" in card.mesaflash()


def test_the_card_answers_in_time(card: ServedCard):
    """mesaflash looks once, 2 ms after its first request; real-time here, so that it is not late itself."""
    for _ in range(5):
        found = card.mesaflash(priority=30, check=False)
        assert "ETH device 7I92" in found, f"no answer within 2 ms: {found}"


@pytest.mark.parametrize(("spec", "device"), [("7i76e", "7I76E"), ("7i96", "7I96"), ("7i80hd", "7I80HD-16")])
def test_other_cards_are_found(network, tmp_path: Path, spec: str, device: str):
    with ServedCard(network, tmp_path, spec) as card:
        assert f"ETH device {device} at" in card.mesaflash(device=device)
        assert "Modules in configuration" in card.mesaflash("--readhmid", device=device)


def test_readhmid_modules_are_those_we_report(card: ServedCard):
    text = card.mesaflash("--readhmid")
    info, modules = card.hm2("info")["idrom"], card.hm2("modules")
    assert re.search(r"BoardName : (\S+)", text)[1] == info["board_name"]
    assert number(text, "FPGA Size") == info["fpga_size"]
    assert number(text, "Number of IO Ports") == info["io_ports"]
    assert number(text, "Width of one I/O port") == info["port_width"]
    assert number(text, "FPGA Pins") == info["fpga_pins"]
    assert number(text, "IDROM Type") == info["type"]
    assert [number(text, f"Instance Stride {n}") for n in (0, 1)] == info["instance_strides"]
    assert [number(text, f"Register Stride {n}") for n in (0, 1)] == info["register_strides"]
    assert float(re.search(r"Clock Low frequency: ([\d.]+)", text)[1]) * 1e6 == info["clock_low"]
    assert float(re.search(r"Clock High frequency: ([\d.]+)", text)[1]) * 1e6 == info["clock_high"]
    theirs = [
        (
            number(block, "There"),
            number(block, "Version"),
            number(block, "Registers"),
            number(block, "BaseAddress", 16),
            number(block, "Register Stride"),
            number(block, "Instance Stride"),
            float(re.search(r"ClockFrequency: ([\d.]+)", block)[1]) * 1e6,
        )
        for block in blocks(text.split("Configuration pin-out")[0], r" +Module: ")
    ]
    ours = [
        (
            module["instances"],
            module["version"],
            module["num_registers"],
            module["base"],
            module["register_stride"],
            module["instance_stride"],
            module["clock"],
        )
        for module in modules
    ]
    assert theirs == ours


# mesaflash's names of functions, and ours
FUNCTIONS = {
    "TXEn": "tx_enable ",
    "TXData": "tx ",
    "RXData": "rx ",
    "MuxSel": "select ",
    "MuxQ-A": "a",
    "MuxQ-B": "b",
    "MuxQ-IDX": "index",
}


def test_readhmid_connectors_are_those_we_report(card: ServedCard):
    """Connector, its pin, the I/O number, module, channel, function and direction of every pin."""
    theirs, connector = [], ""
    for line in card.mesaflash("--readhmid").split("Configuration pin-out")[1].splitlines():
        words = line.split()
        if line.startswith("IO Connections for"):
            connector = words[-1]
        elif len(words) >= 4 and words[2] == "IOPort":
            theirs.append((connector, int(words[0]), int(words[1]), *words[3:]))
    ours = []
    for pin in card.hm2("pins"):
        place = (pin["connector"], pin["connector_pin"], pin["index"])
        if not pin["module"] or not pin["secondary_gtag"]:
            ours.append((*place, "None"))
            continue
        names = [name for name, mine in FUNCTIONS.items() if pin["function"].startswith(mine)]
        number = pin["function"].removeprefix(FUNCTIONS[names[0]])
        unit = str(pin["secondary_unit"] & 0x7F)
        module = {"sserial": "SSerial", "muxed_encoder": "MuxedQCount"}.get(pin["module"], "MuxedQCountSel")
        direction = "(Out)" if pin["is_output"] else "(In)"
        ours.append((*place, module, unit, names[0] + number, direction))
    assert theirs == ours
    assert len(ours) == 34


def test_print_pd_pins_are_those_we_report(card: ServedCard):
    text, pins = card.mesaflash("--print-pd"), card.hm2("pins")
    theirs = []
    for block in blocks(text, r" +pin \d+:"):
        words = [number(block, "Primary Tag", 16)]
        if "Secondary Tag" in block:
            words += [number(block, f"Secondary {what}", 16) for what in ("Tag", "Unit", "Pin")]
        theirs.append(tuple(words))
    assert len(theirs) == len(pins) == 34
    for pin, words in zip(pins, theirs, strict=True):
        secondary = tuple(pin[f"secondary_{what}"] for what in ("gtag", "unit", "pin"))
        assert words == (pin["primary_gtag"], *(secondary if secondary[0] else ())), pin


def test_rpo_reads_the_words_we_read(card: ServedCard):
    ours = {
        row["address"]: row["word"]
        for row in [*card.hm2("peek", "0x100", "4"), *card.hm2("peek", "0x400", "64")]
    }
    for address, word in ours.items():
        assert int(card.mesaflash("--rpo", f"0x{address:04X}").strip().splitlines()[-1], 16) == word, hex(
            address
        )


def test_wpo_writes(card: ServedCard):
    card.mesaflash("--wpo", "0x1100=0x1F")  # direction of port 0
    card.mesaflash("--wpo", "0x1000=0x15")
    word = int(card.mesaflash("--rpo", "0x1000").strip().splitlines()[-1], 16)
    assert word & 0x1F == 0x15


def test_verbose_tells_what_we_report(card: ServedCard):
    text, ours = card.mesaflash("--verbose"), card.hm2("ip")
    facts, counters = ours["card"], ours["counters"]
    assert f"mac address: {MAC.upper()}" in text
    assert f"ip address: {facts['eeprom_ip']}" in text
    assert f"board name: {facts['name']}" in text
    assert f"LBP16 protocol version {facts['lbp_version']}" in text
    assert f"board firmware version {facts['firmware_version']}" in text
    assert f"FPGA type: {facts['part']}" in text
    assert "fixed from EEPROM" in text
    assert "parse errors: 0, mem errors 0, write errors 0" in text
    assert counters["parse_errors"] == counters["memory_errors"] == counters["write_errors"] == 0
    for line in (
        "0: HostMot2 (registers, RW, 32-bit) [size=64K]",
        "3: FPGAFlsh (flash, RW, 32-bit) [size=16M]",
    ):
        assert line in text


def test_sserial_finds_the_remotes_we_find(card: ServedCard):
    text = card.mesaflash("--sserial")
    assert "SSLBP Version: 1.43" in text
    assert "SSLBP Channels: 3" in text
    theirs = {
        int(channel): int(unit, 16)
        for channel, unit in re.findall(r"device at channel (\d+): 7I77 \S+ \(unit (0x[0-9a-fA-F]+)\)", text)
    }
    ours = {
        remote["channel"]: remote["unit_number"] for remote in card.hm2("sserial", "scan") if remote["found"]
    }
    assert theirs == ours
    assert len(theirs) == 2
    for block in blocks(text, r" +sserial device"):
        channel = number(block, "channel")
        ours = {
            parameter["name"]: parameter["value"]
            for parameter in card.hm2("param", "list", f"0.{channel}")["parameters"]
        }
        assert BAUD_RATES[re.search(r"NVBaudRate = (\S+)", block)[1]] == ours["NVBaudRate"]
        assert number(block, "NVUnitNumber =", 16) == ours["NVUnitNumber"]
        assert number(block, "NVWatchDogTimeout =") == ours["NVWatchDogTimeout"]
    assert re.findall(r"SOFTWARE MODE (\S+) \[index (\d+)\]", text) == [
        (name, f"{index:02}") for name, index in our_modes(card)
    ]


BAUD_RATES = {"2.5Mb": 9}

OUR_MODES = """
import json, sys, hostmot2
with hostmot2.open(sys.argv[1]) as board:
    board.sserial[0].scan()
    channels = [channel for channel in board.sserial[0].channels if channel.description]
    print(json.dumps([[mode.name, mode.index] for channel in channels for mode in channel.modes]))
"""


def our_modes(card: ServedCard) -> list[tuple[str, int]]:
    """Software modes of all remotes, as our driver finds them."""
    command = card.network.in_card(sys.executable, "-c", OUR_MODES, f"udp://{CARD_IP}")
    return [(name, index) for name, index in json.loads(run(*command))]


def test_flash_write_verify_backup(card: ServedCard, tmp_path: Path):
    image, other, backup = tmp_path / "image.bit", tmp_path / "other.bit", tmp_path / "all.bin"
    image.write_bytes(xilinx(payload(150_001)))
    other.write_bytes(xilinx(payload(150_001, seed=2)))
    assert "verified successfully" in card.mesaflash("--write", str(image))
    assert "verified successfully" in card.mesaflash("--verify", str(image))
    assert "Error at" in card.mesaflash("--verify", str(other), check=False)
    card.hm2("flash", "verify", str(image))  # what it wrote is what we find
    card.mesaflash("--backup-flash", str(backup))
    ours = tmp_path / "ours.bin"
    card.hm2("flash", "backup", "-o", str(ours))
    assert backup.read_bytes() == ours.read_bytes()
    assert backup.read_bytes()[0x100000 : 0x100000 + 150_001] == payload(150_001)


def test_what_we_write_mesaflash_verifies(card: ServedCard, tmp_path: Path):
    image = tmp_path / "image.bit"
    image.write_bytes(xilinx(payload(70_144, seed=3)))
    card.hm2("flash", "write", "--yes", str(image))
    text = card.mesaflash("--verify", str(image))
    assert "Boot sector OK" in text
    assert "verified successfully" in text


def test_set_ip_is_what_we_read(card: ServedCard):
    card.mesaflash("--set", "ip=10.10.10.99")
    assert card.hm2("ip")["card"]["eeprom_ip"] == "10.10.10.99"
    card.hm2("ip", "10.10.10.98", "--yes")
    assert "ip address: 10.10.10.98" in card.mesaflash("--verbose")


def test_reload_comes_back(card: ServedCard):
    card.mesaflash("--reload", check=False)
    run("sleep", "0.5")
    assert "ETH device 7I92" in card.mesaflash()


def test_two_clients_at_once(card: ServedCard):
    """Each with its own port: answers go to who asked."""
    for _ in range(5):
        assert card.hm2("info")["name"] == "7I92"
        assert "55AACAFE" in card.mesaflash("--rpo", "0x100")
