"""Differences: of two networks, of a network and other descriptions, of a bus and its files.

Add here: a kind of difference with its place and its finding. Do not add: rules that need one
network only (`rules`), pages that show a difference (`report`), readers of files (`formats`).
"""
