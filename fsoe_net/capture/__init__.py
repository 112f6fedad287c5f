"""Frames recorded by other programs: decoded, found in hex, written, dissected.

Add here: names for the content of a frame, a writer of captures, fields of the dissector. Do not
add: readers of captures as descriptions of a bus (`formats/capture`), CRC and layout of a safety
frame (`fsoe`).
"""
