"""Command line: one module per command, the only layer that prints or exits.

Add here: a command with its options and the printing of its result. Do not add: work that the
studio or a program could also use; it belongs in a lower layer.
"""

import gc
import os
import sys


def start() -> None:
    """Run the command line and exit; Ctrl-C while it is loading prints no traceback."""
    # Modules have no garbage; searching them at the start and at the exit took 15 % of a `check`.
    gc.set_threshold(100_000)
    try:
        from fsoe_net.cli.main import main as run
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        sys.stderr.flush()
        os._exit(130)
    try:
        run()
    finally:
        gc.freeze()
