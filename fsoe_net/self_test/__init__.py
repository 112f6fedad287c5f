"""The self-test: this installation, tried with networks and runs whose results are known.

What is expected is in `reference.yaml` and `estop.frames` beside this file and in the examples. Add
here: a part with known answers of a standard or a foreign program. Do not add: results that this
package has computed itself, or tests of the development (`tests`).
"""
