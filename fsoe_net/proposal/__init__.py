"""A first network from whatever files and buses a user has.

Add here: a source of facts for a proposal, a question that only the user can answer. A value that
nobody has stated stays open; nothing is guessed. Do not add: readers of files (`formats`),
questions at a terminal (`cli`).
"""
