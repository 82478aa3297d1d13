"""The emulated card: EmulatedBoard and EmulatedRemote, for people who write tests."""

from hostmot2.emulator.board import EmulatedBoard
from hostmot2.emulator.cards import CardDescription
from hostmot2.emulator.described import DescribedRemote
from hostmot2.emulator.description import Parameter, RemoteDescription, SoftwareMode
from hostmot2.emulator.remote import EmulatedRemote, RemoteWrite

__all__ = [
    "CardDescription",
    "DescribedRemote",
    "EmulatedBoard",
    "EmulatedRemote",
    "Parameter",
    "RemoteDescription",
    "RemoteWrite",
    "SoftwareMode",
]
