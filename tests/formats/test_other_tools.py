"""linuxcnc-ethercat, IgH nodes for ROS, TwinSAFE exports."""

from __future__ import annotations

import pytest
from data_files import need
from formats.texts import LCEC, ROS_SLAVES, TWINSAFE

from fsoe_net.formats.lcec.read import load_lcec
from fsoe_net.formats.ros_slaves.read import load_ros_slaves
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.twinsafe.read import load_twinsafe


def lcec(text: str, *codes: str, **options: int):
    out = Collector()
    found = load_lcec(text.encode(), out, name="x.xml", **options)
    assert [d.code for d in out.diagnostics] == list(codes), out.diagnostics
    assert all(d.hint for d in out.diagnostics)
    return found, out.diagnostics


def test_lcec_configuration_is_read():
    found, _ = lcec(LCEC)
    assert found is not None
    assert found.cycle_us == 2000
    assert [(s.position, s.order, s.name) for s in found.subdevices] == [
        (0, "EK1100", "0"),
        (1, "EL6900", "logic"),
        (2, "EL1904", "2"),
        (4, "EL2904", "out"),
        (5, "", "5"),
    ]
    assert [(c.main, c.sub, c.slot) for c in found.connections] == [(1, 3, 0), (1, 2, 1)]
    device = found.subdevices[4].device
    assert (device.vendor_id, device.product_code, device.assign_activate) == (2, 0x1A5F3052, 0x300)
    assert [(s.index, s.subindex, s.value) for s in device.sdos] == [(0x8000, 0x0A, 0x0201)]
    (outputs, inputs) = device.layout.managers
    assert (outputs.bits, inputs.bits) == (24, 0)
    assert outputs.placed[0].entry.address == "0x7000:10"


@pytest.mark.parametrize(
    ("find", "put", "word"),
    [
        ('value="4"', 'value="3"', "no SubDevice of this master"),
        ('value="4"', 'value="1"', "the logic itself"),
        ('value="4"', 'value="2"', "given twice"),
        ('idx="4" type', 'idx="2" type', "two SubDevices with idx 2"),
    ],
)
def test_lcec_connections_that_cannot_be(find: str, put: str, word: str):
    out = Collector()
    load_lcec(LCEC.replace(find, put).encode(), out, name="x.xml")
    assert out.diagnostics[0].code == "FSN148"
    assert word in out.diagnostics[0].message


def test_invalid_numbers_of_lcec_are_reported():
    lcec(LCEC.replace('vid="00000002"', 'vid="#x2"'), "FSN141")
    lcec(LCEC.replace('bitLen="16"', 'bitLen="0x10"'), "FSN141")
    lcec(LCEC.replace(' bitLen="16"', ""), "FSN141")
    lcec(LCEC.replace('dir="in"', 'dir="left"'), "FSN141")


def test_one_of_several_lcec_masters_is_read():
    two = LCEC.replace("</masters>", '<master idx="7"><slave idx="0" type="A"/></master></masters>')
    found, _ = lcec(two, "FSN147")
    assert found is not None
    assert len(found.subdevices) == 5
    named = two.replace('<master idx="7"', '<master idx="7" name="far"')
    for text, master in ((two, "7"), (named, "7"), (named, "far")):
        found, _ = lcec(text, master=master)
        assert found is not None
        assert [s.order for s in found.subdevices] == ["A"]
    assert lcec(LCEC, "FSN140", master="3")[0] is None
    assert lcec("<masters/>", "FSN140")[0] is None
    assert lcec("<robot/>", "FSN140")[0] is None
    assert lcec(LCEC[:300], "FSN118")[0] is None


def ros(text: str, *codes: str):
    out = Collector()
    found = load_ros_slaves(text.encode(), out, name="x.yaml")
    assert [d.code for d in out.diagnostics] == list(codes), out.diagnostics
    return found


def test_ethercat_slaves_yaml_is_read():
    found = ros(ROS_SLAVES)
    assert found is not None
    assert found.cycle_us == 500
    assert [(s.name, s.position, s.alias) for s in found.subdevices] == [
        ("right", 0, 3),
        ("left", 1, 0),
    ]
    left = found.subdevices[1]
    assert (left.device.vendor_id, left.device.assign_activate) == (0xA12, 0x700)
    assert left.notes == ("this file has no PDOs", "input_port 0x6010")


def test_ros_slaves_of_others():
    out = Collector()
    found = load_ros_slaves(need("yaml", "mikekaram_ethercat_slaves.yaml"), out)
    assert found is not None
    assert out.diagnostics == []
    assert [s.position for s in found.subdevices] == [0, 1, 2, 3]
    assert found.cycle_us == 1000


def test_ros_slaves_that_are_wrong():
    ros(ROS_SLAVES.replace("    position: 1\n", ""), "FSN141")
    ros(ROS_SLAVES.replace("position: 1", "position: one"), "FSN111")
    assert ros("ethercat_slaves: []\n", "FSN140") is None
    assert ros("nets: []\n", "FSN140") is None
    assert ros("ethercat_slaves: {a: [}\n", "FSN102") is None


def twinsafe(text: str, *codes: str):
    out = Collector()
    found = load_twinsafe(text.encode(), out, name="x.xml")
    assert [d.code for d in out.diagnostics] == list(codes), out.diagnostics
    return found


def test_twinsafe_export_is_read():
    found = twinsafe(TWINSAFE)
    assert found is not None
    assert found.subdevices[0].notes == ("FSoE address 9",)
    assert [(s.order, s.module_ident) for s in found.subdevices[1:]] == [
        ("EL2904", (290,)),
        ("", ()),
    ]
    first, second = found.connections
    assert (first.main, first.sub, first.slot) == (0, 1, 0)
    assert (first.address, first.connection_id, first.watchdog_ms) == (4, 3, 100)
    assert first.app_parameters == bytes.fromhex("06000001")
    assert first.at("ConId").line == 7
    assert (second.main, second.sub, second.slot) == (2, 0, 1)


def test_twinsafe_that_is_wrong():
    twinsafe(TWINSAFE.replace("<ConId>3</ConId>", ""), "FSN141")
    twinsafe(TWINSAFE.replace("<ConId>3</ConId>", "<ConId>x</ConId>"), "FSN141")
    twinsafe(TWINSAFE.replace("<Size>4</Size>", "<Size>8</Size>"), "FSN141")
    twinsafe(TWINSAFE.replace("06000001", "0600000"), "FSN141")
    assert twinsafe("<Project/>", "FSN140") is None
    assert twinsafe("<robot/>", "FSN140") is None
    assert twinsafe(TWINSAFE[:200], "FSN118") is None
