"""FSoE as seen on the wire: frames, CRCs, MainInstance and SubInstance.

Compared with independent implementations, not checked against ETG.5100 and not conformance tested:
for emulation and test, never part of a safety function. Knows nothing of EtherCAT; time is an
argument. `fsoe_net.fsoe.recording` compares recorded runs with the engine.
"""
