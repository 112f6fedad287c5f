"""The report of a network as a document, a module per family of sections; other printed pages.

Add here: a section, and the open point that it makes where something is missing. Do not add: what
decides an acceptance (`acceptance`), differences (`compare`), layout of pages (`document`).
"""
