"""The record of tests at a machine: its steps, tried on an emulated bus or by a person.

Add here: a kind of step with what is expected and how its times are measured. Do not add: the file
format (`formats/own`), the printed page (`report`).
"""
