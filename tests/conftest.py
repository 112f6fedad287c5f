"""Shared settings: correctness tests have no time limits; a loaded machine is no failure."""

from hypothesis import settings

settings.register_profile("fsn", deadline=None)
settings.load_profile("fsn")
