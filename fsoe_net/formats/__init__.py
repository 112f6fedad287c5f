"""Reads files into the model and writes them; every value has its place; mistakes are diagnostics.

Add here: a folder per format with its `Format`, reader, writer and limits; commands find it
automatically. Treat every file as hostile until it is checked. Do not add: rules over several files
(`rules`, `compare`).
"""
