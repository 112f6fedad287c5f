"""Times of a safety function: what the formulas say, what limits them, sums of PFH."""
