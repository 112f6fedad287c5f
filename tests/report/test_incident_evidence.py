"""An incident file is evidence: it is told with its plan, and damaged ones are refused."""

from __future__ import annotations

import json

import pytest
from incident.rig import Rig, network
from report.made import inputs_of

from fsoe_net.errors import InputError
from fsoe_net.report.evidence import read_evidence
from fsoe_net.report.formats import render_report


def test_an_incident_file_is_reported(tmp_path):
    folder = tmp_path / "made"
    folder.mkdir()
    rig = Rig(network("estop", folder), folder, steps="  - {at_ms: 300, break: ek1914}\n")
    rig.run(1_500)
    data = rig.end().read_bytes()
    path = tmp_path / "x.fsnincident"
    path.write_bytes(data)
    evidence = read_evidence(str(path))
    assert evidence.incident is not None
    inputs = inputs_of(next(folder.glob("net*/network.yaml")), evidence=(evidence,))
    document = json.loads(render_report(inputs, "json"))
    shown = json.dumps(next(b for b in document["blocks"] if b["key"] == "bus_evidence"))
    assert "el1918-ek1914" in shown
    assert "this plan" in shown
    path.write_bytes(b'{"incident": 1}\n')
    with pytest.raises(InputError, match="is not evidence"):
        read_evidence(str(path))
