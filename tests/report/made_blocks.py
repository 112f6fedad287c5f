"""Networks of the report, with much and with little."""

from __future__ import annotations

SPARSE = (
    ("    required_reaction_ms: 300\n", ""),
    ("    required: {pl: d}\n", ""),
    (
        "name: ES1, time_ms: 5, pfh_per_hour: 1.0e-8, claim: {pl: d}, source: sheet of the maker",
        "name: ES1, time_ms: 5",
    ),
    ("position: 1,", "position: 1, alias: 7,"),
    ("10, watchdog_ms: 100", "10, watchdog_ms: 100, unconfirmed: asked by mail"),
    ('parameters: "01 00"', 'parameters: "01 00", unconfirmed: true'),
)
LOCAL = """\
  - name: local stop
    elements:
      - {kind: logic, name: relay, time_ms: 4, pfh_per_hour: 1.0e-9, source: sheet of the maker}
"""
