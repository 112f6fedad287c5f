"""A network compiled to a copy plan; `.fsnplan` files are written, read and shown.

Add here: a record of the plan, with its proof in C (`master_core/src/plan`) and its line in the
fingerprint. Do not add: anything that the cycle does not need.
"""
