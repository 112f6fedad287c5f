"""FSoE as seen on the wire: frames, CRCs, MainInstance and SubInstance.

Compared with independent implementations, not checked against ETG.5100 and not conformance tested:
for emulation and test, never part of a safety function. Add here: a state, a frame form, a term for
observations of a passive monitor. Do not add: EtherCAT, files, faults on the path (`campaign`);
time is an argument.
"""
