"""The record of tests at a machine: its steps, done on an emulated bus or by a person.

Add here: a kind of step with its expected result and the measurement of its times. Do not add: the
file format (`formats/own`), the printed page (`report`).
"""
