"""What holds for every test."""

from hypothesis import settings

# no test is timed: a busy machine, or the sanitizers, would fail it
settings.register_profile("hostmot2", deadline=None)
settings.load_profile("hostmot2")
