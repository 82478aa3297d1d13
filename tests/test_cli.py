"""The command line as scripts see it: output, --json and exit codes of interface.md."""

import json

import pytest


@pytest.fixture(autouse=True)
def no_board_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("HM2_BOARD", raising=False)
    monkeypatch.delenv("HM2_DEBUG", raising=False)


EMULATED = ("--board", "emu://5i25+7i77?clock=virtual")


def test_without_a_board_the_emulated_card_is_used_and_said_so_on_stderr(hm2) -> None:
    status, out, err = hm2("info")
    assert status == 0
    assert "MESA5I25" in out
    assert "emu://5i25+7i77" in err


def test_the_environment_names_the_board(hm2, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HM2_BOARD", "emu://5i25+7i77x2")
    status, out, err = hm2("info", "--json")
    assert (status, err) == (0, "")
    assert json.loads(out)["modules"]["muxed_encoder"] == 12


@pytest.mark.parametrize("arguments", [("--json", "info"), ("info", "--json")])
def test_json_is_one_document_on_stdout(hm2, arguments: tuple[str, ...]) -> None:
    status, out, _ = hm2(*EMULATED, *arguments)
    assert status == 0
    assert json.loads(out)["idrom"]["clock_low"] == 33333333


def test_modules_and_pins_are_those_of_the_idrom(hm2) -> None:
    """registers.md 3.2: 6 modules, 34 pins, I/O 7 is the multiplexer's select."""
    modules = json.loads(hm2(*EMULATED, "--json", "modules")[1])
    assert [module["name"] for module in modules][:3] == ["watchdog", "ioport", "muxed_encoder"]
    pins = json.loads(hm2(*EMULATED, "--json", "pins")[1])
    assert len(pins) == 34
    assert (pins[7]["module"], pins[7]["connector"], pins[7]["connector_pin"]) == (
        "muxed_encoder_select",
        "P3",
        17,
    )
    assert "P3-17" in hm2(*EMULATED, "pins")[1]


def test_peek_shows_words_with_their_names(hm2) -> None:
    status, out, _ = hm2(*EMULATED, "peek", "0x100", "2")
    assert status == 0
    assert "0x55AACAFE" in out
    assert "id config_name_low" in out
    document = json.loads(hm2(*EMULATED, "--json", "peek", "0xD00")[1])
    assert document == [
        {"address": 0xD00, "word": 1, "register": "watchdog status", "fields": {"has_bitten": 1}}
    ]


def test_peek_says_when_a_register_cannot_be_read(hm2) -> None:
    assert "write-only" in hm2(*EMULATED, "peek", "0x200")[2]


def test_poke_writes_only_when_told_yes(hm2, tmp_path) -> None:
    card = tmp_path / "card"
    image = bytearray(0x10000)
    from hostmot2.emulator import EmulatedBoard

    board = EmulatedBoard("5i25+7i77", clock="virtual")
    for address in range(0x100, 0x800, 4):
        image[address : address + 4] = board.read(address).to_bytes(4, "little")
    card.write_bytes(image)
    url = f"pci://{card}"
    status, _, err = hm2("--board", url, "poke", "0x1104", "0x155")
    assert (status, card.read_bytes()) == (2, bytes(image))
    assert "ioport 1 ddr" in err
    status, out, _ = hm2("--board", url, "poke", "0x1104", "0x155", "--yes")
    assert status == 0
    assert "wrote 0x00000155 to 0x1104" in out
    assert card.read_bytes()[0x1104:0x1108] == b"\x55\x01\0\0"


@pytest.mark.parametrize(
    ("arguments", "status", "why"),
    [
        (("no-such-command",), 2, "No such command 'no-such-command'"),
        (("peek", "0x101"), 2, "0x101 is not a multiple of 4"),
        (("peek", "0x10000"), 2, "0x10000 is outside 0..0xFFFC"),
        (("peek", "banana"), 2, "'banana' is not a number"),
        (("peek", "0xFFFC", "2"), 2, "2 words from 0xFFFC on reach beyond 0xFFFF"),
        (("--board", "nonsense://x", "info"), 2, "nonsense"),
        (("--board", "pci:///no/such/file", "info"), 3, "/no/such/file"),
    ],
)
def test_exit_codes_tell_what_went_wrong(hm2, arguments: tuple[str, ...], status: int, why: str) -> None:
    found, _, err = hm2(*arguments)
    assert (found, why in err) == (status, True), err


def test_an_error_with_json_is_a_document_too(hm2) -> None:
    status, out, err = hm2("--json", "--board", "pci:///no/such/file", "info")
    error = json.loads(out)["error"]
    assert (status, error["exit_code"], error["type"]) == (3, 3, "CardNotFound")
    assert error["message"] in err


@pytest.mark.parametrize(
    "arguments", [("peek", "zz"), ("poke", "0x1000", "0"), ("flash", "info"), ("info", "--bogus")]
)
def test_wrong_usage_with_json_is_a_document_too(hm2, arguments: tuple[str, ...]) -> None:
    status, out, err = hm2("--json", "--board", "emu://5i25+7i77", *arguments)
    error = json.loads(out)["error"]
    assert (status, error["exit_code"], error["message"] in err) == (2, 2, True)


@pytest.mark.parametrize("arguments", ["info emu://5i25+7i77", "emu://5i25+7i77 info", "info --board pci://"])
def test_a_card_named_behind_the_command_is_told_its_place(hm2, arguments: str) -> None:
    status, _, err = hm2(*arguments.split())
    assert (status, "hm2 --board URL COMMAND" in err) == (2, True)


def test_a_file_that_is_no_card_is_a_device_fault(hm2, tmp_path) -> None:
    (tmp_path / "zeros").write_bytes(bytes(0x10000))
    status, _, err = hm2("--board", f"pci://{tmp_path / 'zeros'}", "info")
    assert status == 6
    assert "cookie" in err


def test_the_table_of_commands_can_all_be_imported(hm2) -> None:
    from hostmot2.cli.main import COMMANDS

    status, out, _ = hm2("--help")
    assert status == 0
    assert all(name in out for name in COMMANDS)


def test_two_dumps_of_a_card_differ_where_it_was_written(hm2, tmp_path) -> None:
    first, second = tmp_path / "first.hm2dump", tmp_path / "second.hm2dump"
    assert hm2(*EMULATED, "dump", "-o", str(first))[0] == 0
    second.write_text(first.read_text().replace("1104 00000000", "1104 00000155"))
    status, out, _ = hm2("diff", str(first), str(second), "--json")
    assert status == 0
    assert json.loads(out) == [{"address": 0x1104, "name": "ioport 1 ddr", "left": 0, "right": 0x155}]
    assert hm2("diff", str(first), str(first))[1] == "no difference\n"
    assert "MESA5I25" in hm2("--board", f"dump://{first}", "info")[1]


@pytest.mark.parametrize("what", ["HM2-E053", "E053", "WrongCookie"])
def test_an_error_code_is_explained_by_any_of_its_names(hm2, what: str) -> None:
    status, out, _ = hm2("explain", what)
    assert status == 0
    assert "0x55AACAFE" in out


def test_every_error_code_is_explained_and_belongs_to_one_error(hm2) -> None:
    found = json.loads(hm2("explain", "--json")[1])
    codes = [entry["code"] for entry in found]
    assert len(codes) == len(set(codes))
    assert all(entry["meaning"] for entry in found)
    assert {"TransportTimeout", "NoRemote", "BrokenTable"} <= {entry["error"] for entry in found}


def test_a_status_word_is_explained(hm2) -> None:
    """sserial.md 3.2: remote fault 4 active."""
    document = json.loads(hm2("explain", "CS=0x04422140", "--json")[1])
    assert document["state"] == "running"
    assert document["live"] == ["over temperature"]
    assert "communication error" in document["sticky"]
    assert hm2("explain", "E999")[0] == 2


def test_sserial_scan_names_the_remotes_of_a_7i77(hm2) -> None:
    """sserial.md 8.1, 8.2: channel 0 field I/O (0x12), 1 analog (0x11), 2 the connector for others."""
    status, out, _ = hm2(*EMULATED, "sserial", "scan", "--json")
    assert status == 0
    rows = json.loads(out)
    assert [(row["name"], row["unit_number"] >> 24) for row in rows] == [
        ("7I77", 0x12),
        ("7I77", 0x11),
        ("", 0),
    ]
    assert rows[2]["result"] == "no answer"


def test_sserial_start_tells_what_started(hm2) -> None:
    status, out, _ = hm2(*EMULATED, "--json", "sserial", "start", "0x03", "--run", "0.01")
    document = json.loads(out)
    assert (status, document["started"], document["failed"], document["failed_exchanges"]) == (0, 3, 0, 0)
    assert document["inputs"].keys() == {"0", "1"}


def test_sserial_start_of_an_empty_channel_is_a_device_fault_with_a_checklist(hm2) -> None:
    status, out, _ = hm2(*EMULATED, "sserial", "start", "4")
    assert status == 6
    assert "failed 0x04" in out
    assert "cable" in out


def test_sserial_status_and_counters_name_every_channel(hm2) -> None:
    """sslbp_observed2.md: a 7I77 alone has 3 channels; CS after STOP ALL is C100."""
    status = json.loads(hm2(*EMULATED, "--json", "sserial", "status")[1])
    assert status["revision"] == "1.43"
    assert [channel["cs"] for channel in status["channels"]] == [0xC100] * 3
    counters = json.loads(hm2(*EMULATED, "--json", "sserial", "counters")[1])
    assert [row["timeouts"] for row in counters] == [0, 0, 0]


def test_sserial_stop_stops_all_channels_and_says_so(hm2) -> None:
    """Its first use resets the port."""
    assert json.loads(hm2(*EMULATED, "--json", "sserial", "stop", "0x02")[1]) == {"stopped": 0xFF}
    assert "Always all channels" in hm2("sserial", "stop", "--help")[1]


def test_sserial_refuses_ports_and_masks_that_cannot_be(hm2) -> None:
    assert hm2(*EMULATED, "sserial", "scan", "--port", "1")[0] == 2
    status, _, err = hm2(*EMULATED, "sserial", "start", "0x100")
    assert (status, "0x100 is outside 0..0xFF" in err) == (2, True)
