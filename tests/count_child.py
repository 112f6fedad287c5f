"""Counts the lines of the confined child of xacro, which can write no file: into one opened before.

Its process has no environment, so `conftest` names the file in the program text of the child.
"""

from __future__ import annotations

import fcntl
import os
import uuid
from pathlib import Path


def count_confined_children() -> None:
    """Make the child of xacro count where scripts/coverage runs the tests."""
    config = os.environ.get("COVERAGE_PROCESS_START")
    if config is None:
        return
    import fsoe_net.formats.ros2.xacro_expand as expand

    folder = Path(os.environ["FSN_COVERAGE_DATA"]).parent
    here = str(Path(__file__).parent)
    expand._CHILD = (
        f"import sys; sys.path.append({here!r})\n"
        f"from count_child import counted; counted({config!r}, {str(folder)!r})"
    )


def counted(config: str, folder: str) -> None:
    """Run the child; what it counted goes into a file of the folder."""
    import coverage

    from fsoe_net.formats.ros2.xacro_child import main

    if coverage.Coverage.current() is not None:  # trusted: it has the environment, and counts
        main()
        return
    counter = coverage.Coverage(data_file=None, config_file=config)
    try:
        file = os.open(f"{folder}/child.{uuid.uuid4().hex}", os.O_WRONLY | os.O_CREAT, 0o600)
    except OSError:  # the folder is gone
        main()
        return
    # Far up, where the hostile files of the tests do not look for the answer.
    low, file = file, fcntl.fcntl(file, fcntl.F_DUPFD, 500)
    os.close(low)
    counter.start()
    try:
        main()
    finally:
        counter.stop()
        os.write(file, counter.get_data().dumps())
