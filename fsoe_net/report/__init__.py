"""The report of a network as a document, with a module per group of sections; other printed pages.

Add here: a section, and its open point for missing data. Do not add: decisions about an acceptance
(`acceptance`), differences (`compare`), layout of pages (`document`).
"""
