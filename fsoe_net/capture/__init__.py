"""Frames recorded by other programs: decoding, hex input, a dissector, and start-ups.

Add here: names for the content of a frame, a writer of captures, fields of the dissector, what a
start-up shows of a bus. Do not add: the content of packets (`formats/capture`), CRC and layout of a
safety frame (`fsoe`).
"""
