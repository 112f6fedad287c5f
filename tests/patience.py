"""How long a test waits for what must come, in seconds.

Only a test that waits in vain sees the end of it, so it is long: a busy machine takes its time. It
is below the time-out of a test, so that a rig says what it has waited for, and is tried again.
"""

PATIENCE_S = 200.0
