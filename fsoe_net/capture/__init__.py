"""Frames that somebody else has recorded: decoded, found in hex, written, dissected.

Add here: names for what is seen in a frame, a writer of captures, fields of the dissector. Do not
add: readers of captures as descriptions of a bus (`formats/capture`), CRC and layout of a safety
frame (`fsoe`).
"""
