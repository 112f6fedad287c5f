"""Parameters on the wire, beside those of the plan and of the files."""

import zlib
from dataclasses import replace

import pytest

from fsoe_net.document.model import Level, Verdict
from fsoe_net.fsoe.parameters import NOT_OBSERVED, FsoeParameters
from fsoe_net.report.evidence import RunRow
from fsoe_net.report.section_evidence import observed_cell

APP = bytes.fromhex("01000000")


def sent(app=APP, **changes):
    values = {"connection_id": 3, "address": 201, "watchdog_ms": 100}
    return FsoeParameters(**values | changes, app_bytes=len(app), app_crc=zlib.crc32(app))


PLAN = sent()
AS_STATED = [
    ("clear", "as stated"),
    "ConnID 3, address 201, 100 ms, 4 bytes of application parameters",
]
BOTH = sent(watchdog_ms=4000, connection_id=2099)
DRIVE = "el6910-drive_1"


@pytest.mark.shows("R16")
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
            [
                (
                    "error",
                    f"{DRIVE}: FSoE address unknown now; different from the plan at an earlier "
                    "start-up, 201 in the plan",
                )
            ],
        ),
        (
            DRIVE,
            sent(b"abcd"),
            ("app_parameters",),
            [
                (
                    "error",
                    f"{DRIVE}: application parameters 4 bytes, CRC-32 0xed82cd11, 4 bytes, "
                    "CRC-32 0x99f8b879 in the plan",
                )
            ],
        ),
    ],
)
def test_observed_values_are_judged(name, observed, differs, said):
    row = RunRow(
        name=name, state="data_process", cycle_mean=4.0, cycle_max=4.0, watchdog=100.0, resets=0,
        reset_text="", configured=PLAN, observed=observed, differs=differs,
    )  # fmt: skip
    found = observed_cell(name, row)
    assert [(i.level.value, i.word) if isinstance(i, Verdict) else i.text for i in found] == said


def test_application_parameters_that_no_one_states_are_not_compared():
    row = RunRow(
        name=DRIVE, state="data_process", cycle_mean=4.0, cycle_max=4.0, watchdog=100.0, resets=0,
        reset_text="", configured=replace(PLAN, app_bytes=None, app_crc=None), observed=sent(),
        differs=(),
    )  # fmt: skip
    verdict, words = observed_cell(DRIVE, row)
    assert verdict == Verdict("application parameters not compared", Level.OPEN)
    assert words.text == AS_STATED[1] + ", which the network does not state"
