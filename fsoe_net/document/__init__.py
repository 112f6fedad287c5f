"""Documents as data, and the writers that convert them to pages, text and JSON.

Add here: a kind of block, a writer. Blocks are independent of FSoE. Do not add: contents of a
report (`report`).
"""
