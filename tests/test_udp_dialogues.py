"""Every datagram of the UDP driver, byte by byte, against reviewed text: tests/golden/udp."""

from __future__ import annotations

import pytest
from lbp16_reference import parse, reply_size
from udp_dialogue import GOLDEN, Numbers, load, reply_lines, request_lines
from udp_peer import Peer
from udp_scenarios import SCENARIOS, Session, chain


def play(name: str) -> None:
    peer = Peer()
    session = Session(peer)
    try:
        for step in chain(name):
            peer.play(step)
            SCENARIOS[step].run(session)
            peer.finished()
            assert not peer.problem
    finally:
        problem = peer.problem
        session.close()
        if problem:
            pytest.fail(problem, pytrace=False)


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_driver_says_what_stands_in(name: str):
    play(name)


@pytest.mark.parametrize("name", SCENARIOS)
def test_what_is_written_beside_the_bytes_is_what_they_say(name: str):
    """The text is the plain decoding of the bytes; a reply is as long as its request asks for."""
    numbers, requests = Numbers(n=0x10000000, p=0x20000000), {}
    for datagram in load(name).datagrams:
        data = numbers.bytes(datagram.hex)
        if datagram.kind == ">":
            requests[datagram.number] = data
            assert datagram.lines == request_lines(data, numbers)
        else:
            request = requests[datagram.number]
            assert datagram.lines == reply_lines(request, data, numbers)
            assert len(data) == reply_size(parse(request))


def test_there_is_a_scenario_for_every_dialogue():
    assert {path.stem for path in GOLDEN.glob("*.txt")} == set(SCENARIOS)
