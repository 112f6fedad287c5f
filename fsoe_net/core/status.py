"""The status codes of the C core, from its own table."""

from __future__ import annotations

from dataclasses import dataclass

from fsoe_net.core.module import compiled

_LOWEST = -127  # values are small and negative


@dataclass(frozen=True, slots=True, kw_only=True)
class StatusInfo:
    """A status: name, such as ``FSN_E_BUS_SILENT``, value (-64), meaning, and action."""

    name: str
    value: int
    text: str
    next_step: str


def status_table() -> tuple[StatusInfo, ...]:
    """Return every status that is an error.

    Raises:
        CoreMissing: The compiled module is missing.
    """
    ffi, lib = compiled()
    rows = (
        StatusInfo(
            value=value,
            **{
                key: ffi.string(function(value)).decode()
                for key, function in (
                    ("name", lib.fsn_status_name),
                    ("text", lib.fsn_status_text),
                    ("next_step", lib.fsn_status_next_step),
                )
            },
        )
        for value in range(-1, _LOWEST, -1)
    )
    # A number without a status has the name FSN_E_?.
    return tuple(row for row in rows if not row.name.endswith("?"))
