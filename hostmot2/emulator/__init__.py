"""The emulated card: EmulatedBoard and EmulatedRemote, for people who write tests."""

from hostmot2.emulator.remote import EmulatedRemote, RemoteWrite

__all__ = ["EmulatedRemote", "RemoteWrite"]
