"""Real captures, compared with what tshark says of the same packets; and start-ups of our own."""

from __future__ import annotations

import importlib.util
import json
import shutil
import subprocess
from pathlib import Path

import pytest
from capture.tshark import tshark
from data_files import need
from weekly import first
from wires import missing, run_program

from fsoe_net.capture.start_up import load_capture
from fsoe_net.diag.diagnostic import Severity
from fsoe_net.formats.own.network import load_network
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.resolve import resolve

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
ATTEMPTS = 4
EK1914 = "ethercrab_replay-ek1914-no-complete-access.pcapng"
CAPTURES = {
    "ethercrab_replay-ek1100-el2828-el2889.pcapng": [
        (0x044C2C52, "EK1100", []),
        (0x0B0C3052, "EL2828", [(0, 8)]),
        (0x0B493052, "EL2889", [(0, 8), (1, 8)]),
    ],
    EK1914: [(0x077A2C52, "EK1914", [(2, 64), (3, 64)]), (0x0BBC3052, "EL3004", [(3, 128)])],
    "ethercrab_soem-sdinfo-ek1100-el1004.pcapng": [
        (0x044C2C52, "EK1100", []),
        (0x03EC3052, "EL1004", []),  # SOEM reads the lengths of its entries only
    ],
    "ethercrab_soem-single-lan9252.pcapng": [(0x9252, "", [(2, 16), (3, 48)])],
}


def described(path):
    out = Collector()
    found = load_capture(path, out)
    assert found is not None, out.diagnostics
    assert not [d for d in out.diagnostics if d.level is Severity.ERROR]
    return found


def sizes(sub):
    layout = sub.device.layout
    return [(m.sm.index, m.bits) for m in layout.managers if m.bits]


@pytest.mark.parametrize("name", CAPTURES)
def test_real_capture_gives_devices_and_sizes(name):
    found = described(need("pcap", name))
    rows = [(s.device.product_code, s.order, sizes(s)) for s in found.subdevices]
    assert rows == CAPTURES[name]
    assert [s.position for s in found.subdevices] == list(range(len(rows)))


def fields(path, wanted, *names):
    """Return the fields of the packets that tshark picks."""
    given = [part for name in names for part in ("-e", name)]
    done = subprocess.run(
        [tshark(), "-r", str(path), "-Y", wanted, "-T", "fields", *given],
        capture_output=True,
        text=True,
        check=True,
    )
    return [line.split("\t") for line in done.stdout.splitlines()]


def number(text):
    return int(text, 0)


@pytest.mark.parametrize("name", CAPTURES)
def test_identity_and_addresses_are_those_tshark_shows(name):
    """Station addresses in ring order; words of the EEPROM by the addresses they were asked for."""
    path = need("pcap", name)
    rows = fields(path, "ecat.reg.physaddr && ecat.cmd == 2 && ecat.cnt == 1", "ecat.reg.physaddr")
    addresses = list(dict.fromkeys(number(row[0]) for row in rows))
    asked, words = {}, {}
    names = ("ecat.adp", "ecat.reg.addrl", *(f"ecat.reg.data{n}" for n in range(4)))
    for adp, address, *data in fields(
        path, "ecat.cnt == 1 && (ecat.reg.addrl || ecat.reg.data0)", *names
    ):
        station = number(adp)
        if address:
            asked[station] = number(address)
        for n, word in enumerate(data):
            if word:
                words[station, asked[station] + n] = number(word)
    found = described(path)
    for station, sub in zip(addresses, found.subdevices, strict=True):
        vendor, product, revision = (
            words[station, at] | words[station, at + 1] << 16 for at in (0x8, 0xA, 0xC)
        )
        assert (sub.device.vendor_id, sub.device.product_code) == (vendor, product)
        assert sub.revision == revision


def test_mapping_is_the_one_tshark_shows():
    """Every upload that tshark sees answered, put together by hand, gives the same entries."""
    path = need("pcap", EK1914)
    names = ("ecat.adp", "ecat_mailbox.coe.sdoidx", "ecat_mailbox.coe.sdosub")
    names = (*names, "ecat_mailbox.coe.sdodata", "ecat_mailbox.coe.sdores")
    asked, values = {}, {}
    for adp, index, sub, data, answer in fields(path, "ecat_mailbox.coe && ecat.cnt == 1", *names):
        station = number(adp)
        if not answer:
            asked[station] = (number(index), number(sub))
        elif station in asked and data:
            values[station, *asked.pop(station)] = number(data)
    stations = sorted({station for station, *_ in values})
    checked = 0
    for station, sub in zip(stations, described(path).subdevices, strict=True):
        for sm in sub.device.sync_managers:
            assert [p.index for p in sm.pdos] == [
                values[station, 0x1C10 + sm.index, n + 1] for n in range(len(sm.pdos))
            ]
            for pdo in sm.pdos:
                rows = [values[station, pdo.index, n + 1] for n in range(len(pdo.entries))]
                assert [e.index << 16 | e.subindex << 8 | e.bits for e in pdo.entries] == rows
                checked += len(rows)
    assert checked > 40


# -- start-ups of the emulated segment ------------------------------------------------------------


def captured(who, where, network, path):
    """Return what the rig saw; a busy machine may need a few goes."""
    if reason := missing():
        pytest.skip(reason)
    for _ in range(ATTEMPTS):
        done = run_program("formats/capture_rig.py", who, where, network, path)
        if done.returncode == 0:
            return json.loads(done.stdout.splitlines()[-1])
    pytest.fail(f"{ATTEMPTS} times: {done.stderr}")


@pytest.mark.parametrize("where", first(1, ["near", "far"]))
@pytest.mark.parametrize("who", ["soem", "fsn"])
@pytest.mark.parametrize("name", first(1, ["el6910", "estop"]))
def test_a_start_up_gives_back_the_network(who, where, name, tmp_path):
    if who == "soem" and importlib.util.find_spec("pysoem") is None:
        pytest.skip("pysoem is not installed: pip install -e '.[peers]'")
    if who == "fsn" and shutil.which("fsn-master") is None:
        pytest.skip("fsn-master is not built: make master")
    network = EXAMPLES / name / "network.yaml"
    path = tmp_path / "start-up.pcapng"
    loaded = load_network([str(network)]).network
    assert loaded is not None
    wanted = transfers(resolve(loaded))
    for _ in range(ATTEMPTS):
        captured(who, where, network, path)
        found = described(path)
        assert copies(found) <= wanted
        if copies(found) == wanted:  # on a busy machine a SubDevice may leave OP before it is used
            break
    by_position = {s.position: s for s in found.subdevices}
    for own in loaded.subdevices:
        assert own.device is not None
        sub = by_position[own.position]
        assert sub.name in (own.name, "")  # SOEM reads names of equal devices once
        identity = (own.device.vendor_id, own.device.product_code)
        assert (sub.device.vendor_id, sub.device.product_code) == identity
        assert placed(sub.device) == placed(own.device)
    assert {s.position for s in found.subdevices} == set(range(len(found.subdevices)))
    assert copies(found) == wanted


def placed(device):
    return {
        m.sm.index: [(p.bit_offset, p.entry.address, p.entry.bits) for p in m.placed]
        for m in device.layout.managers
        if m.bits
    }


def copies(found):
    return {
        tuple(
            (found.subdevices[e.subdevice].position, e.sm_index, e.bit_offset)
            for e in (c.source, c.destination)
        )
        for c in found.copies
    }


def transfers(resolution):
    places = {s.name: s.position for s in resolution.network.subdevices}
    rows = set()
    for row in resolution.transfers:
        ends = (row.source, row.destination)
        rows.add(tuple((places[e.endpoint.module], e.sm.sm.index, 8 * e.byte_offset) for e in ends))
    return rows
