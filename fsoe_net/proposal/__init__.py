"""Proposes an initial network from the files and buses of a user.

Add here: a source of facts for a proposal, a question that only the user can answer. A value that
is not stated stays open; values are never guessed. Do not add: readers of files (`formats`),
questions at a terminal (`cli`).
"""
