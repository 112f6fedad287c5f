"""Diagnostics: what is wrong in a user's file, as data with a place and a fix."""
