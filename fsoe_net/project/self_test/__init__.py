"""The self-test: this installation, tried with networks and runs whose results are known.

What is expected is in `reference.yaml` and `estop.frames` beside this file and in the examples.
"""
