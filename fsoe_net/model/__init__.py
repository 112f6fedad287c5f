"""The network as the user's files describe it: frozen dataclasses, no I/O.

Add here: a part of a network, and what follows from its parts alone (layout, resolution). Do not
add: files (`formats`), judgement (`rules`), anything that asks the clock.
"""
