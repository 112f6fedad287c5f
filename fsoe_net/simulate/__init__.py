"""An emulated bus with FSoE devices and drives on it, and the scenarios that are run on it.

Add here: devices, drives, events of a scenario, the emulated EtherCAT segment. Devices know sync
managers only, never the core; time is given. Do not add: the FSoE state machines (`fsoe`), faults
on the way and their judges (`campaign`), anything that a live bus needs too (`live`).
"""
