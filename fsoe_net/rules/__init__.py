"""The rules: errors in a network, as diagnostics. One module per family.

Add here: a rule with its code, place, next step, page, fixture and clean counterpart. A rule reads
the model only. Do not add: comparison with another description (`compare`), readers of files
(`formats`).
"""
