"""Parameters on the wire, beside those of the plan and of the files."""

import zlib

import pytest
from networks import EXAMPLES
from report.made import inputs_of

from fsoe_net.document.model import Verdict
from fsoe_net.fsoe.parameters import NOT_OBSERVED, FsoeParameters
from fsoe_net.report.evidence import RunRow
from fsoe_net.report.observed import observed_cell

APP = bytes.fromhex("01000000")
PLAN = FsoeParameters(connection_id=3, address=201, watchdog_ms=100)


def sent(app=APP, **changes):
    values = {"connection_id": 3, "address": 201, "watchdog_ms": 100}
    return FsoeParameters(**values | changes, app_bytes=len(app), app_crc=zlib.crc32(app))


AS_STATED = [
    ("clear", "as stated"),
    "ConnID 3, address 201, 100 ms, 4 bytes of application parameters",
]
BOTH = sent(watchdog_ms=4000, connection_id=2099)
DRIVE = "el6910-drive_1"


@pytest.mark.parametrize(
    ("name", "observed", "differs", "said"),
    [
        (DRIVE, sent(), (), AS_STATED),
        (DRIVE, NOT_OBSERVED, (), [("open", "not observed")]),
        (DRIVE, FsoeParameters(connection_id=3, address=201), (), [("open", "not observed")]),
        (
            DRIVE,
            BOTH,
            ("connection_id", "watchdog_ms"),
            [
                ("error", f"{DRIVE}: connection ID 2099, 3 in the plan"),
                ("error", f"{DRIVE}: watchdog 4000 ms, 100 ms in the plan"),
            ],
        ),
        (
            DRIVE,
            NOT_OBSERVED,
            ("address",),
            [("error", f"{DRIVE}: FSoE address another one before, 201 in the plan")],
        ),
        (
            DRIVE,
            sent(b""),
            (),
            [("error", f"{DRIVE}: 0 bytes of application parameters, 4 stated")],
        ),
        (
            DRIVE,
            sent(b"abcd"),
            (),
            [("error", f"{DRIVE}: other application parameters than stated, 4 bytes")],
        ),
        ("of another network", sent(b"abcd"), (), AS_STATED),
    ],
)
def test_what_was_observed_is_judged(name, observed, differs, said):
    row = RunRow(
        name=name, state="data_process", cycle_mean=4.0, cycle_max=4.0, watchdog=100.0, resets=0,
        reset_text="", configured=PLAN, observed=observed, differs=differs,
    )  # fmt: skip
    found = observed_cell(name, row, inputs_of(EXAMPLES / "el6910" / "network.yaml"))
    assert [(i.level.value, i.word) if isinstance(i, Verdict) else i.text for i in found] == said
