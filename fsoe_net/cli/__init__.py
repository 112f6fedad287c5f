"""Command line: one module per command, the only layer that prints or exits.

Add here: a command with its options and the printing of its result. Do not add: work that the
studio or a program could also use; it belongs in a lower layer.
"""

import os
import sys


def start() -> None:
    """Run the command line and exit; Ctrl-C while it is loading prints no traceback."""
    try:
        from fsoe_net.cli.main import main as run
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        sys.stderr.flush()
        os._exit(130)
    run()
