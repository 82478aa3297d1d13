"""The keys by which a served card is steered: what can be read and set, and what is refused."""

import socket
import subprocess
import sys
import threading

import pytest

import hostmot2
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.emulator.control import Controls, ControlServer, answer, ask
from hostmot2.emulator.described import DescribedRemote
from hostmot2.emulator.ethernet import EthernetServer, Fault


@pytest.fixture
def controls():
    board = EmulatedBoard("7i92+7i77", clock="virtual")
    with EthernetServer(board) as server:
        yield Controls(board, server)


def test_faults_are_read_back_as_they_were_set(controls):
    for key, value in (
        ("loss", 0.5),
        ("dup", 0.25),
        ("reorder", 1),
        ("delay", 100),
        ("jitter", 7),
        ("seed", 3),
    ):
        assert answer(controls, f"set fault.{key} {value}") == "ok"
        assert float(answer(controls, f"get fault.{key}")) == value
    assert answer(controls, "set fault.replies 0") == "ok"
    assert answer(controls, "get fault.replies") == "0"


def test_a_change_of_another_fault_does_not_draw_the_same_again():
    """A seed is set once: another setting later goes on with the same draw."""
    board = EmulatedBoard("7i92+7i77", clock="virtual")
    with EthernetServer(board) as server:
        steered = Controls(board, server, Fault(seed=5))
        assert answer(steered, "get fault.seed") == "5"
        assert answer(steered, "set fault.loss 0.1") == "ok"
        assert answer(steered, "get fault.seed") == "0"


def test_counters_encoders_leds_and_elements(controls):
    assert answer(controls, "get requests") == "0"
    assert answer(controls, "get replies") == "0"
    assert answer(controls, "set encoder0_position 12") == "ok"
    assert answer(controls, "get encoder0_position") == "12"
    assert answer(controls, "get encoder0_rate") == "0"
    assert answer(controls, "set encoder0_rate -1000") == "ok"
    assert answer(controls, "get encoder0_rate") == "-1000"
    assert answer(controls, "get led0") == "0"
    assert answer(controls, "set 0.fieldvoltage 0x10") == "ok"
    assert float(answer(controls, "get fieldvoltage")) == pytest.approx(16, abs=0.5)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("get fault.color", "faults are"),
        ("set fault.loss 2", "a probability is 0 to 1"),
        ("set fault.delay -1", "-1.0 is negative"),
        ("set led0 1", "can only be read"),
        ("get led99", "LEDs"),
        ("get x.fieldvoltage", "no key"),
        ("get 7.fieldvoltage", "no daughter card 7"),
        ("get nothing", "no remote of daughter card 0"),
        ("get encoder99_rate", ""),
        ("set fieldvoltage much", "could not convert"),
        ("fly", "get KEY, or set KEY VALUE"),
    ],
)
def test_what_there_is_none_of_is_said(controls, line, said):
    text = answer(controls, line)
    assert text.startswith("error: ")
    assert said in text


READ_COOKIE = bytes.fromhex("01420001")


def test_the_card_answers_while_somebody_looks_at_it(monkeypatch):
    """A real card does not wait for its observers: LinuxCNC gives it 0.8 ms."""
    looking, go_on = threading.Event(), threading.Event()

    def get(_remote, _name):
        looking.set()
        assert go_on.wait(10)
        return 7

    monkeypatch.setattr(DescribedRemote, "get", get)
    board, said = EmulatedBoard("7i92+7i77", clock="real"), []
    with EthernetServer(board) as server, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as host:
        controls = Controls(board, server)
        observer = threading.Thread(target=lambda: said.append(answer(controls, "get output")))
        observer.start()
        assert looking.wait(10)
        host.settimeout(5)
        host.sendto(READ_COOKIE, (server.host, server.port))
        assert host.recv(100) == bytes.fromhex("fecaaa55")
        go_on.set()
        observer.join(10)
    assert said == ["7"]


def test_looks_and_packets_from_many_threads_take_turns():
    """The remotes work, encoders turn, three threads look and steer: every answer is one that can be."""
    emulated, over, wrong = EmulatedBoard("7i92+7i77", clock="real"), threading.Event(), []
    with EthernetServer(emulated) as server, hostmot2.open(server.url) as board:
        controls = Controls(emulated, server)
        board.watchdog.timeout = 10  # threads of the interpreter wait for each other
        card = board.card("7i77")
        card.start()

        def look(number):
            while not over.is_set():
                for line in (f"set encoder{number}_rate 20000", f"get encoder{number}_position", "get led0"):
                    wrong.extend(text for text in [answer(controls, line)] if "error" in text)
                if answer(controls, "set input 0xA5A5A5A5") != "ok" or answer(controls, "get output") != "0":
                    wrong.append("process data")

        observers = [threading.Thread(target=look, args=(number,)) for number in range(3)]
        for observer in observers:
            observer.start()
        for _ in range(500):
            card.exchange()
        over.set()
        for observer in observers:
            observer.join()
        assert not wrong
        assert int(card.inputs) == 0xA5A5A5A5


FORK = """
import os, sys
from hostmot2.emulator.board import EmulatedBoard
from hostmot2.emulator.control import ControlServer, Controls, ask
from hostmot2.emulator.ethernet import EthernetServer
board = EmulatedBoard("7i92+7i77")
with EthernetServer(board) as server, ControlServer(sys.argv[1], Controls(board, server)):
    child = os.fork()
    if not child:
        sys.exit(3)
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), ask(sys.argv[1], "get", "requests"))
"""


def test_a_forked_child_that_leaves_the_block_leaves_the_socket_to_its_parent(tmp_path):
    path = tmp_path / "control"
    done = subprocess.run(
        [sys.executable, "-c", FORK, str(path)], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.stdout == "3 0\n", done.stderr
    assert not path.exists()


def test_a_socket_left_by_a_killed_emulator_is_replaced_and_no_other_file(controls, tmp_path):
    path = tmp_path / "control"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as killed:
        killed.bind(str(path))
    with ControlServer(path, controls):
        assert ask(path, "get", "requests") == "0"
        with pytest.raises(OSError, match="in use"):
            ControlServer(path, controls)
        assert ask(path, "get", "requests") == "0", "one that answers stays"
    path.write_text("keep me")
    with pytest.raises(OSError, match="in use"):
        ControlServer(path, controls)
    assert path.read_text() == "keep me"


def test_a_client_that_is_gone_before_its_answer_ends_alone(controls, tmp_path):
    with ControlServer(tmp_path / "control", controls) as server:
        ours, theirs = socket.socketpair()
        ours.sendall(b"get requests\n" * 2000)
        ours.close()
        server._serve(theirs)
        assert ask(tmp_path / "control", "get", "requests") == "0"


@pytest.mark.parametrize("said", [b"", b"requests"])
def test_an_emulator_that_ends_before_its_answer_is_an_error(tmp_path, said):
    """Not an empty answer, nor half of one: nobody knows whether the key was set."""
    path = tmp_path / "control"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as ending:
        ending.bind(str(path))
        ending.listen()

        def serve():
            client, _ = ending.accept()
            with client:
                client.recv(4096)
                client.sendall(said)

        thread = threading.Thread(target=serve)
        thread.start()
        with pytest.raises(ConnectionResetError) as caught:
            ask(path, "set", "output", "1")
        thread.join()
    assert caught.value.filename == str(path)


def test_an_emulator_that_hangs_up_at_once_is_no_reader_that_has_seen_enough(tmp_path, monkeypatch):
    path = tmp_path / "control"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as ending:
        ending.bind(str(path))
        ending.listen()
        connect = socket.socket.connect

        def connect_and_lose(client, address):
            connect(client, address)
            ending.accept()[0].close()

        monkeypatch.setattr(socket.socket, "connect", connect_and_lose)
        with pytest.raises(ConnectionResetError):
            ask(path, "set", "output", "1")
