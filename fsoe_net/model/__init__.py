"""The network as described in the user's files: frozen dataclasses, no I/O.

Add here: a part of a network, and results derived from its parts alone (layout, resolution). Do not
add: files (`formats`), judgement (`rules`), anything that reads a clock.
"""
