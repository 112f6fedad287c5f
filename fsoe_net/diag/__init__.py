"""Diagnostics: errors in a user's file, as data with a place and a fix.

Add here: a code and its title, a kind of place. A new diagnostic also needs a page, a fixture and a
clean counterpart. Do not add: rules (`rules`), output (`cli`).
"""
