"""FSoE as seen on the wire: frames, CRCs, MainInstance and SubInstance.

Compared with independent implementations, not checked against ETG.5100 and not conformance tested:
for emulation and test, never part of a safety function. Add here: a state, a frame form, a word
for what a passive monitor sees. Do not add: EtherCAT, files, faults on the way (`campaign`); time
is an argument.
"""
