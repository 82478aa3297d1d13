"""Record the dialogues of the UDP driver anew, for review: python tests/udp_record.py DIRECTORY [NAME...]

Writes into DIRECTORY, never by itself into tests/golden/udp. Look at every difference; copy what is right:

    python tests/udp_record.py /tmp/new && diff -ru tests/golden/udp /tmp/new
"""

from __future__ import annotations

import argparse
from pathlib import Path

from udp_dialogue import dump
from udp_facts import Facts
from udp_peer import RecordingPeer
from udp_scenarios import SCENARIOS, Session, chain


def record(name: str) -> str:
    """The text of a dialogue."""
    peer = RecordingPeer(Facts().answer)
    session = Session(peer)
    try:
        for step in chain(name):
            scenario = SCENARIOS[step]
            behind = f" Behind {scenario.after}.txt." if scenario.after else ""
            peer.record(step, f"# {scenario.title[0].upper()}{scenario.title[1:]}.{behind}", scenario.plan)
            scenario.run(session)
        return dump(peer.dialogue)
    finally:
        session.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("directory", type=Path)
    parser.add_argument("names", nargs="*", default=list(SCENARIOS))
    options = parser.parse_args()
    options.directory.mkdir(parents=True, exist_ok=True)
    for name in options.names:
        (options.directory / f"{name}.txt").write_text(record(name))


if __name__ == "__main__":
    main()
