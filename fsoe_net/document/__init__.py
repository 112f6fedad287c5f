"""Documents as data, and the writers that make pages, text and JSON of them.

Add here: a kind of block, a writer. Blocks are independent of FSoE. Do not add: contents of a
report (`report`).
"""
