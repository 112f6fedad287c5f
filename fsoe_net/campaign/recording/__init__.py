"""Recorded runs (§13): reading them and comparing them with the engine."""
