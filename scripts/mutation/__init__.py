"""Mutants of the house: what both languages share, and one half for each."""
