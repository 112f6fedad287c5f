"""An emulated bus with FSoE devices and drives, and the scenarios that run on it.

Add here: devices, drives, events of a scenario, the emulated EtherCAT segment. Devices depend only
on sync managers, never on the core; time is an argument. Do not add: the FSoE state machines
(`fsoe`), faults on the path and their judges (`campaign`), anything that a live bus also needs
(`live`).
"""
