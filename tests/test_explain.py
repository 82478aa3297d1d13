"""hm2 explain: codes, words and registers in plain words. Words and their meaning: sserial.md 2, 3.2, 3.3."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from hostmot2.cli.catalogue import all_errors, short
from hostmot2.cli.main import main
from hostmot2.registers import ComState, LocalFault
from hostmot2.sserial.words import explain_command, explain_cs, explain_data


@pytest.fixture(autouse=True)
def no_board_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("HM2_BOARD", raising=False)


@pytest.fixture
def explained(capsys: pytest.CaptureFixture[str]):
    def run(*arguments: str) -> tuple[int, str]:
        with pytest.raises(SystemExit) as end:
            main(["explain", *arguments])
        said = capsys.readouterr()
        return int(end.value.code or 0), said.out or said.err

    return run


@pytest.mark.parametrize("kind", all_errors(), ids=short)
def test_every_code_is_explained_with_causes_and_what_to_do(explained, kind) -> None:
    status, out = explained(short(kind))
    assert status == 0
    assert f"{kind.code} {kind.__name__}" in out
    assert out.index("Likely") < out.index("What to do") < out.index("Exit status")
    document = json.loads(explained(kind.__name__, "--json")[1])
    assert document["causes"] == list(kind.causes)
    assert document["exit_code"] in range(2, 8)


def test_no_remote_has_the_checklists_of_the_cards(explained) -> None:
    out = explained("NoRemote")[1]
    assert "7I77, only one is silent: field I/O:" in out
    assert "TB2-5" in out
    assert "8I20" in out
    checklists = json.loads(explained("E021", "--json")[1])["checklists"]
    assert set(checklists) == {"7i77", "8i20"}


# word, state, names of what holds now, names of what was since the last stop
CS_WORDS = [
    (0x0000C100, "stopped", {"not ready", "no remote identified"}, {"remote fault"}),
    (0x00420000, "running", set(), set()),
    (0x003C0000, "running", set(), set()),
    (0x00400000, "setup", set(), set()),
    (0x003A0000, "chatter", set(), set()),
    (0x00422008, "running", set(), {"communication error", "timeout"}),
    (0x00422009, "running", set(), {"communication error", "timeout", "CRC error"}),
    (0x00422088, "running", set(), {"communication error", "timeout", "too many errors"}),
    (0x04422140, "running", {"over temperature"}, {"communication error", "remote fault"}),
    (0x00422140, "running", set(), {"communication error", "remote fault"}),
    (0x003B2088, "dead", set(), {"communication error", "timeout", "too many errors"}),
    (0x01422140, "running", {"watchdog bitten"}, {"communication error", "remote fault"}),
]


@pytest.mark.parametrize(("word", "state", "now", "since"), CS_WORDS)
def test_a_cs_word_in_its_parts(word: int, state: str, now: set[str], since: set[str]) -> None:
    words = explain_cs(word)
    live = {part.name for part in words.parts if part.live}
    assert live == now | {state}
    assert {part.name for part in words.parts if not part.live} == since
    assert words.summary


def test_bits_of_a_cs_word_are_where_the_parts_say() -> None:
    for bit in [*range(8), 8, 13, 14, 15, *range(24, 32)]:
        parts = explain_cs(0x00420000 | 1 << bit).parts
        assert str(bit) in {part.bits for part in parts}


@pytest.mark.parametrize("word", [0x203A0000, 0x2000C100])
def test_a_fault_byte_of_before_the_start_is_not_told_as_a_fault(word: int) -> None:
    words = explain_cs(word)
    assert "reports a fault" not in words.summary
    assert words.do == ""
    (part,) = [part for part in words.parts if part.bits == "29"]
    assert (part.live, part.text[:22]) == (False, "left over from before ")


def test_advice_follows_the_word() -> None:
    assert "start" in explain_cs(0x01422140).do
    assert "software mode" in explain_cs(0x4024A1C0).do
    assert "counters" in explain_cs(0x00422088).do
    assert "scan" in explain_cs(0x0001E188).do
    assert explain_cs(0x00420000).do == ""
    assert "Nothing is wrong" in explain_cs(0x00420000).summary


@pytest.mark.parametrize(
    ("word", "said"),
    [
        (0x1003, "channels 0 and 1"),
        (0x1001, "channel 0"),
        (0x1103, "never completes"),
        (0x0900 | 0x04, "Start channel 2 with process data"),
        (0x0F0B, "Start channels 0, 1 and 3 in set-up mode"),
        (0x0800, "STOP ALL"),
        (0x0802, "Stop channel 1"),
        (0x08FF, "hung"),
        (0x2003, "Read the firmware's variable at 0x003"),
        (0xA09A, "Write the firmware's variable at 0x09A"),
        (0x4000, "reset"),
        (0x0081, "No such command"),
        (0x0A01, "No such command"),
        (0x0000, "idle"),
        (0x80000000, "ignored"),
    ],
)
def test_a_command_word(word: int, said: str) -> None:
    assert said in explain_command(word).summary


@pytest.mark.parametrize(
    ("word", "said"),
    [
        (0x00, "no channel failed"),
        (0x04, "channel 2 failed"),
        (0xAA, "STOP ALL"),
        (0xFF, "does not exist"),
        (0xABCD, "program"),
    ],
)
def test_a_data_word(word: int, said: str) -> None:
    assert said in explain_data(word).summary


@pytest.mark.parametrize("what", ["0x00422088", "CS=0x00422088", "cs=0x422088"])
def test_a_cs_word_at_the_prompt(explained, what: str) -> None:
    status, out = explained(what)
    assert status == 0
    assert "Process data runs" in out
    assert "since the last stop" in out
    document = json.loads(explained(what, "--json")[1])
    assert document["state"] == "running"
    assert "timeout" in document["sticky"]


def test_a_short_word_is_a_command_or_a_result_unless_it_is_a_stopped_channel(explained) -> None:
    assert set(json.loads(explained("0x1003", "--json")[1])) == {"word", "command"}
    assert {"cs", "command"} <= set(json.loads(explained("0xC100", "--json")[1]))
    assert {"command", "data"} <= set(json.loads(explained("0x03", "--json")[1]))


def test_a_register_and_its_value(explained) -> None:
    """0x5A00 is COMMAND with register map A, 0x5B00 DATA there and COMMAND with map B (registers.md)."""
    out = explained("0x5A00=0x81")[1]
    assert "sserial 0 command" in out
    assert "No such command" in out
    found = json.loads(explained("0x5B00=0x03", "--json")[1])
    assert [(each["register"], "Ethernet" in each["card"]) for each in found] == [
        ("sserial 0 data", False),
        ("sserial 0 command", True),
    ]
    assert found[0]["fields"]["result"] == 3


def test_a_register_of_the_named_card_only(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--board", "emu://7i92+7i77?clock=virtual", "--json", "explain", "0x5B00=0x03"])
    (found,) = json.loads(capsys.readouterr().out)
    assert found["register"] == "sserial 0 command"


@pytest.mark.parametrize(
    ("what", "why"),
    [
        ("E999", "E999"),
        ("Nonsense", "Nonsense"),
        ("CS=banana", "'banana' is not a number of 32 bits"),
        ("CS=0x100000000", "'0x100000000' is not a number of 32 bits"),
        ("0x5A01F=1", "0x5A01F is beyond the card's registers"),
        ("0x9990=1", "0x9990"),
        ("X=1", "'X' is not a number of 32 bits"),
        ("CS=", "'' is not a number of 32 bits"),
    ],
)
def test_what_cannot_be_explained_is_a_usage_error(explained, what: str, why: str) -> None:
    status, said = explained(what)
    assert (status, why in said) == (2, True), said


def test_codes_of_parts_whose_extra_is_not_installed_are_explained_too() -> None:
    """hostmot2.recording needs mcap; its codes do not."""
    program = (
        "import sys\n"
        "sys.modules['mcap'] = None\n"
        "from hostmot2.cli.main import main\n"
        "main(['explain', 'E111'])\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "BrokenRecording" in done.stdout


def test_a_start_that_gave_up_says_what_to_do(explained) -> None:
    word = ComState.UNIT_NUMBER_GET << 16 | LocalFault.TOO_MANY_ERRORS
    status, out = explained(f"CS=0x{word:08X}")[:2]
    assert status == 0
    assert "start again; `hm2 sserial start MASK` shows the evidence" in " ".join(out.split())
