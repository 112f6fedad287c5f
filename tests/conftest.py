"""Shared settings: correctness tests have no time limits; a loaded machine is no failure."""

from hypothesis import HealthCheck, settings

settings.register_profile("fsn", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("fsn")
