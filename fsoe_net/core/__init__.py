"""Typed facade over the C core; the only importer of the compiled module.

Importing this package works without the compiled part; the first use then raises `CoreMissing`.
"""
