"""Descriptions into files of other tools; whatever is written can be read back."""
