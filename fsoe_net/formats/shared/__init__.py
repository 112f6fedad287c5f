"""Shared by several formats: files, text, XML, YAML, numbers, names.

Add here: code that two formats use. Do not add: code about one format; it belongs in the folder of
that format.
"""
