"""The kind of a SubDevice: by its process data, and by its FSoE role."""

from __future__ import annotations

from dataclasses import replace

import pytest
from networks import EXAMPLES

from fsoe_net.model.kinds import SubDeviceKind, kind_of
from fsoe_net.project.check import check_files


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("el6910", SubDeviceKind.LOGIC),
        ("drive_1", SubDeviceKind.DRIVE),
        ("el2904", SubDeviceKind.TERMINAL),
    ],
)
def test_kinds_of_the_shipped_cell(name: str, kind: SubDeviceKind) -> None:
    resolution = check_files([str(EXAMPLES / "el6910" / "network.yaml")]).resolution
    assert resolution is not None
    network = resolution.network
    sub = network.subdevices[resolution.numbers[name]]
    is_main = any(net.safety_master == name for net in network.nets)
    assert kind_of(sub, is_main=is_main) is kind


def test_without_process_data_it_is_a_coupler_and_without_a_layout_a_terminal() -> None:
    resolution = check_files([str(EXAMPLES / "el6910" / "network.yaml")]).resolution
    assert resolution is not None
    sub = resolution.network.subdevices[0]
    assert sub.device is not None
    bare = replace(sub, device=replace(sub.device, rpdos=(), tpdos=(), sync_managers=()))
    assert kind_of(bare, is_main=False) is SubDeviceKind.COUPLER
    assert kind_of(replace(sub, device=None), is_main=False) is SubDeviceKind.TERMINAL
