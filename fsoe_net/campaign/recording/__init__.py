"""Recorded runs (§13): reading them, and holding them against the engine."""
