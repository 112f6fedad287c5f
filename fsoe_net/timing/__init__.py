"""Times of a safety function: results of the formulas, limits, sums of PFH.

Add here: a formula with its source, a bound with its reason. No I/O. Do not add: findings about
times (`rules/timing.py`), pages (`report`).
"""
