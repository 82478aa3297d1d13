"""Descriptions inside a recording that no recorder writes: an error says which part cannot be, and why."""

import dataclasses
import json
from importlib.metadata import PackageNotFoundError

import pytest
import zstandard
from mcap.records import Chunk

import hostmot2
from hostmot2.emulator import EmulatedBoard, catalog
from hostmot2.errors import PermissionDenied
from hostmot2.recording import BrokenRecording, Recording, RecordingTooLarge, attachments_of, read
from hostmot2.recording import scan as scanning
from hostmot2.recording.descriptors import Descriptors
from hostmot2.recording.format import FORMAT, parse_records_schema, records_schema
from hostmot2.recording.scan import LARGEST_CHUNK, scan
from hostmot2.recording.topics import Thinning
from recording.making import DTYPE, INPUTS, OUTPUTS, record_file, records

DEEP = b'{"registers": [], "more": ' + b"[" * 100_000


def field(text, name):
    return next(each for each in text["fields"] if each["name"] == name)


def test_the_unchanged_description_is_read():
    schema = parse_records_schema(records_schema(DTYPE, INPUTS, OUTPUTS))
    assert [signal.name for signal in schema.inputs] == [signal.name for signal in INPUTS]
    assert schema.dtype.itemsize == DTYPE.itemsize


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda text: text.update(format="hm2-records-99"),
            f"'hm2-records-99'; this version reads '{FORMAT}'",
        ),
        (lambda text: text.update(size=4), "records of 4 bytes"),
        (lambda text: text.update(size=1 << 40), f"records of {1 << 40} bytes"),
        (lambda text: text["fields"].append(field(text, "cycle")), "fields cannot be"),
        (lambda text: field(text, "cycle").update(type="<c16"), "'cycle' of the records cannot be"),
        (lambda text: field(text, "cycle").update(type="|O"), "'cycle' of the records cannot be"),
        (lambda text: field(text, "words").update(count=-1), "'words' of the records cannot be"),
        (lambda text: field(text, "words").update(offset=-8), "'words' of the records cannot be"),
        (lambda text: field(text, "words").update(count=1 << 20), "'words' lies outside"),
        (lambda text: text["fields"].remove(field(text, "status")), "have no status"),
        (lambda text: field(text, "cycle").update(type="<i8"), "'cycle' of the records is int64, not <u8"),
        (lambda text: field(text, "flags").update(count=1), "'flags' of the records is"),
        (lambda text: field(text, "fresh").update(count=0), "too few bits"),
        (lambda text: field(text, "stage_ns").update(count=1), "not all stages"),
        (lambda text: text["inputs"].pop(), "1 inputs are named"),
        (lambda text: text["outputs"].extend(text["inputs"]), "3 outputs are named"),
        (lambda text: text.pop("fields"), "description of the records cannot be read"),
    ],
)
def test_a_description_of_records_that_cannot_be(change, said):
    text = json.loads(records_schema(DTYPE, INPUTS, OUTPUTS))
    change(text)
    with pytest.raises(BrokenRecording, match=said):
        parse_records_schema(json.dumps(text).encode())


@pytest.mark.parametrize("data", [b"", b"{", b"\xff\xfe", b'{"format": "\xff"}', b"null"])
def test_a_description_that_is_no_json(data):
    with pytest.raises(BrokenRecording, match="description of the records cannot be read"):
        parse_records_schema(data)


@pytest.fixture
def contents(tmp_path):
    """What is in a good recording; a test spoils one part of it."""
    return scan(record_file(tmp_path / "run.mcap", records(0, 10)))


@pytest.mark.parametrize(
    ("part", "data", "said"),
    [
        ("image", b"{", "the image cannot be read"),
        ("image", b'{"registers": ["\xff"]}', "the image cannot be read"),
        ("image", DEEP, "the image cannot be read"),
        ("image", b'{"registers": [1.5]}', "the image cannot be read"),
        ("image", json.dumps({"registers": [4] * 99}).encode(), "an image of 99 words for 3 cannot be"),
        ("image", b'{"registers": [65536]}', "an image of 1 words"),
        ("image", b'{"registers": [-4]}', "an image of 1 words"),
        ("image", b'{"registers": [2]}', "an image of 1 words"),
        ("counters", b'{"records": 1}', "the counters cannot be read"),
        ("counters", b"\xff", "the counters cannot be read"),
        ("log", b'{"level": 2, "name": "x"}', "the log cannot be read"),
        ("log", b'{"level": 2, "name": "x", "message": "\xff"}', "the log cannot be read"),
    ],
)
def test_a_message_that_cannot_be(contents, part, data, said):
    spoiled = {"image": {"images": [(0, data)]}, "counters": {"counters": data}, "log": {"log": [(0, data)]}}
    with pytest.raises(BrokenRecording, match=f"run.mcap: {said}"):
        Recording(dataclasses.replace(contents, **spoiled[part]))


def test_without_messages_beside_them_the_records_are_all_there(contents):
    run = Recording(dataclasses.replace(contents, images=[], counters=None, log=[]))
    assert (run.image, run.dropped, run.log) == ((), 0, ())
    assert run.cycle.tolist() == list(range(10))
    assert not run.elements


ELEMENT = {
    "name": "input",
    "kind": 1,
    "bits": 8,
    "direction": 0,
    "minimum": 0.0,
    "maximum": 0.0,
    "unit": "",
}
CHANNEL = {"channel": 0, "status_register": 0x5B00, "registers": [0x5C00], "fields": [ELEMENT]}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda channel: channel.update(registers=[0x5C00] * 99), "channel 0 has more than"),
        (
            lambda channel: channel.update(
                fields=[ELEMENT | {"bits": 64, "name": f"in{n}"} for n in range(9)]
            ),
            "channel 0 has more than",
        ),
        (lambda channel: channel.update(channel=8), "channel 8 at registers"),
        (lambda channel: channel.update(registers=[0x10000]), "channel 0 at registers"),
        (lambda channel: channel.update(status_register=-4), "channel 0 at registers"),
        (lambda channel: channel.update(fields=[ELEMENT | {"input_invert": 256}]), "input has 8 bits"),
        (
            lambda channel: channel.update(fields=[ELEMENT, ELEMENT | {"name": "INPUT", "bits": 4}]),
            "two elements are called INPUT",
        ),
        (lambda channel: channel.update(fields=[ELEMENT | {"kind": 0x55}]), "85 is not a valid FieldKind"),
        (lambda channel: channel.pop("fields"), "cannot be read"),
    ],
)
def test_descriptors_that_cannot_be(described, change, said):
    channel = described["ports"][0]["channels"][0]
    channel.update(json.loads(json.dumps(CHANNEL)))
    Descriptors.parse(json.dumps(described).encode())
    change(channel)
    with pytest.raises(BrokenRecording, match=said):
        Descriptors.parse(json.dumps(described).encode())


@pytest.fixture(scope="module")
def _described():
    with hostmot2.open(EmulatedBoard("5i25+7i77", clock="virtual")) as board:
        board.sserial.start(0x01)
        (data,) = [each.data for each in attachments_of(board) if b'"ports"' in each.data]
    return data


@pytest.fixture
def described(_described):
    """The descriptors of a 7I77, as an attachment has them."""
    return json.loads(_described)


@pytest.mark.parametrize(
    ("chunk", "said"),
    [
        (Chunk("zstd", zstandard.compress(b"x" * 9), 0, 0, 0, 8), "two sizes"),
        (Chunk("lz4", b"x" * 8, 0, 0, 0, 8), "compressed with 'lz4'"),
        (Chunk("", b"x" * 9, 0, 0, 0, 8), "9 bytes instead of 8"),
        (Chunk("", b"x" * 9, 0, 0, 0, LARGEST_CHUNK + 1), f"{LARGEST_CHUNK + 1} bytes unpacked"),
    ],
)
def test_a_chunk_that_is_not_what_it_says_is_left_out_and_named(tmp_path, monkeypatch, chunk, said):
    path = record_file(tmp_path / "run.mcap", records(0, 10))
    real = scanning._Scan._take_chunk

    def take(self, whole):
        real(self, whole)
        real(self, chunk)

    monkeypatch.setattr(scanning._Scan, "_take_chunk", take)
    run = read(path)
    assert run.cycle.tolist() == list(range(10))
    assert all(said in text for text in run.missing)
    assert run.missing


def test_a_file_that_may_not_be_read_says_so(tmp_path, monkeypatch):
    path = record_file(tmp_path / "run.mcap", records(0, 1))

    def refuse(*_arguments, **_options):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("pathlib.Path.open", refuse)
    with pytest.raises(PermissionDenied, match=r"run\.mcap: this user may not read it"):
        read(path)


@pytest.mark.parametrize("text", ["\N{SUPERSCRIPT TWO}", "--5", "9" * 19, "x", "", "1e3", " 5"])
def test_a_time_that_is_no_number_is_none(contents, text):
    changed = contents.metadata | {"hm2.run": {"unix_ns_at_clock_0": text}}
    run = Recording(dataclasses.replace(contents, metadata=changed))
    assert run.unix_ns == 0
    assert run.time_ns.tolist() == run.records["start_ns"].tolist()


@pytest.mark.parametrize("rate", [-1.0, float("nan"), float("inf")])
def test_a_rate_that_is_none_is_refused(rate):
    with pytest.raises(ValueError, match=f"{rate} messages per second"):
        Thinning(rate)


@pytest.mark.parametrize("share", [0.0, 0.2, 0.9])
def test_a_limit_holds_for_attachments_and_for_chunks(tmp_path, share):
    path = record_file(tmp_path / "run.mcap", records(0, 100))
    whole = read(path)
    size = whole.records.nbytes + sum(map(len, whole.attachments.values()))
    assert len(read(path, limit=4 * size).records) == 100
    with pytest.raises(RecordingTooLarge):
        read(path, limit=round(size * share))


def test_padding_is_described_as_room_alone():
    with EmulatedBoard("5i25+7i77", clock="virtual") as card:
        card.sserial[0].attach(2, catalog.remote("stmbl"), through_pins=True)
        with hostmot2.open(card) as board:
            board.sserial.start(0x04).raise_for_failed()
            (data,) = [each.data for each in attachments_of(board) if b'"ports"' in each.data]
    (channel,) = [each for each in json.loads(data)["ports"][0]["channels"] if each["channel"] == 2]
    pads = [field for field in channel["fields"] if field["kind"] == 0]
    assert [field["bits"] for field in pads] == [2, 2]
    assert all(field["input_invert"] == field["output_invert"] == 0 for field in pads)


def test_from_a_source_tree_a_recording_names_no_version(tmp_path, monkeypatch):
    def missing(name):
        raise PackageNotFoundError(name)

    monkeypatch.setattr("hostmot2.recording.file.version", missing)
    path = record_file(tmp_path / "run.mcap", records(0, 1))
    assert b"hostmot2/0 mcap/0" in path.read_bytes()
