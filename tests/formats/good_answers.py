"""Answers that are accepted."""

from __future__ import annotations

GOOD = b"""\
name: cell
cycle_us: 2000
subdevices:
  - {type: EL6910, position: 1}
  - {type: EL1904, name: stop, count: 2, revision: 0x00120000}
main: logic
process_data: {stop_1: device PDO}
frames: {drive: no, other: yes}
connections:
  - {sub: stop_1, main: logic, slot: 1, address: 17, connection_id: 3, watchdog_ms: 100}
"""
