"""The emulated card: EmulatedBoard and EmulatedRemote, for people who write tests."""
