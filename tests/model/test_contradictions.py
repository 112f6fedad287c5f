"""What the device library says, changed in each place: how it contradicts itself or FSoE."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest
from changed import compare, figures

from fsoe_net.formats.own.library import builtin_library
from fsoe_net.model.library import LibraryDevice, LibraryMapping, contradictions

DEVICES = {device.name: device for device in builtin_library().devices}
CHOSEN = ("EL1904", "EL2904", "EL6910", "EL1918", "EK1914")


def _mappings(mapping: LibraryMapping) -> Iterator[tuple[str, LibraryMapping]]:
    yield "source", replace(mapping, source="nowhere")
    yield "no frames", replace(mapping, frames=())
    yield "swapped", replace(mapping, sync_managers=mapping.sync_managers[::-1])
    for n, frame in enumerate(mapping.frames):
        changes = {
            "place": {"byte_offset": frame.byte_offset + 1},
            "manager": {"sm_index": frame.sm_index + 1},
            "length": {"frame_bytes": frame.frame_bytes + 4},
            "safe": {"safe_bytes": frame.safe_bytes + 1},
        }
        for what, change in changes.items():
            rows = [*mapping.frames]
            rows[n] = replace(frame, **change)
            yield f"{what} of {n}", replace(mapping, frames=tuple(rows))
        yield f"without {n}", replace(mapping, frames=mapping.frames[:n] + mapping.frames[n + 1 :])
    for n, manager in enumerate(mapping.sync_managers):
        for k, pdo in enumerate(manager.pdos):
            pdos = manager.pdos[:k] + manager.pdos[k + 1 :]
            managers = [*mapping.sync_managers]
            managers[n] = replace(manager, pdos=pdos)
            yield f"without {pdo.index:x}", replace(mapping, sync_managers=tuple(managers))


def _devices(device: LibraryDevice) -> Iterator[tuple[str, LibraryDevice]]:
    yield "as it is", device
    yield "of a role", replace(device, role="sub")
    yield "bare", replace(device, mappings=())
    yield "bare, of a role", replace(device, mappings=(), role="main")
    yield "without sources", replace(device, sources={})
    yield "twice", replace(device, mappings=device.mappings * 2)
    for n, mapping in enumerate(device.mappings):
        for what, changed in _mappings(mapping):
            rows = (*device.mappings[:n], changed, *device.mappings[n + 1 :])
            yield f"{mapping.name}: {what}", replace(device, mappings=rows)


@pytest.mark.weekly
@pytest.mark.parametrize("name", CHOSEN)
def test_each_change_of_a_device_of_the_library(name: str) -> None:
    rows = [
        (
            what,
            "\n".join(
                f"{type(one).__name__}: {figures(text)}" for one, text in contradictions(device)
            ),
        )
        for what, device in _devices(DEVICES[name])
    ]
    assert rows[0] == ("as it is", "")
    compare(__file__, f"library {name}", rows)


@pytest.mark.parametrize(
    ("first", "last", "fitting"),
    [
        (None, None, [0, 1, 2, 3, 4, None]),
        (2, None, [2, 3, 4, None]),
        (None, 3, [0, 1, 2, 3, None]),
        (2, 3, [2, 3, None]),
    ],
)
def test_revisions_of_a_mapping(first, last, fitting):
    mapping = DEVICES["EL1904"].mappings[0]
    changed = replace(mapping, revision_from=first, revision_to=last)
    assert [r for r in (0, 1, 2, 3, 4, None) if changed.fits(r)] == fitting
