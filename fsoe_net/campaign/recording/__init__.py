"""Recorded runs (§13): reading them and comparing them with the engine.

Add here: a key of a recording and its comparison. Do not add: new faults (`campaign`), captured
frames (`capture`).
"""
