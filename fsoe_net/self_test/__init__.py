"""The self-test: this installation, tested with networks and runs with known results.

Expected results are in `reference.yaml` and `estop.frames` next to this file and in the examples.
`monitor.py` judges frames a second time, without the C core. Add here: a part with known answers
from a standard or a foreign program. Do not add: results computed by this package itself, or
development tests (`tests`).
"""
