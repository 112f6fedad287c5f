"""Shared by several formats: files, text, XML, YAML, numbers, names."""
