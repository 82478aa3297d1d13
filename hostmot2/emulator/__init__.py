"""The emulated card: EmulatedBoard and EmulatedRemote, for people who write tests."""

from hostmot2.emulator.board import EmulatedBoard
from hostmot2.emulator.cards import CardDescription
from hostmot2.emulator.remote import EmulatedRemote, RemoteWrite

__all__ = ["CardDescription", "EmulatedBoard", "EmulatedRemote", "RemoteWrite"]
