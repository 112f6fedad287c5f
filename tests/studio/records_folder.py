"""A network with all that there can be beside it."""

from __future__ import annotations

import shutil
from pathlib import Path

from acceptance.signed import record_of
from incident.rig import Rig, network
from intervention_log.intervention_logs import a_log, written
from report.made import BASE

from fsoe_net.acceptance.accept import record_bytes
from fsoe_net.test_record.trial import Trial


def made_folder(tmp: Path) -> Path:
    """Return the network file in a folder with a test record, a record, an incident and a log."""
    folder, scratch = tmp / "cell", tmp / "scratch"
    shutil.copytree(BASE / "devices", folder / "devices")
    path = folder / "network.yaml"
    shutil.copy(BASE / "timed.yaml", path)
    Trial.of([str(path)]).save(str(folder / "test-record.yaml"))
    (folder / "acceptance.yaml").write_bytes(record_bytes(record_of(path)))
    scratch.mkdir()
    rig = Rig(network("estop", scratch), scratch, steps="  - {at_ms: 300, break: ek1914}\n")
    rig.run(1_500)
    (folder / "incidents").mkdir()
    shutil.move(rig.end(), folder / "incidents" / "a.fsnincident")
    written(folder / "log", a_log(3))
    return path
