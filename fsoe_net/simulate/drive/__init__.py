"""Emulated drives by CiA 402: state machine, motion, safety functions, motor; time is given.

Add here: behaviour of a drive on the bus. Do not add: other devices, the bus, scenarios
(`simulate`), an axis of ``fsn-master`` (`live`).
"""
