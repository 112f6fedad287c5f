"""C headers: compiled with all warnings, asked by a small program, read back and compared."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from described import bus, copy, described_devices, entry
from hypothesis import given, settings
from networks import example
from weekly import examples

from fsoe_net.errors import InputError
from fsoe_net.formats.igh.read import load_igh_text
from fsoe_net.formats.igh.write import write_c_header
from fsoe_net.formats.shared.files import Collector
from fsoe_net.model.bus import Device, Direction, Pdo, SyncManager
from fsoe_net.model.described_network import describe
from fsoe_net.model.description import DescribedSubDevice, Description

FAKE = Path(__file__).parent / "fake"
COMPILERS = [c for c in ("gcc", "clang") if shutil.which(c)]
FLAGS = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow", "-Werror"]

ASK = r"""
#include "bus.h"
#include <stdio.h>

static void show(const fsn_subdevice_t *sub)
{
    printf("sub %s %u %u %x %x %x\n", sub->name, sub->alias, sub->position, sub->vendor_id,
           sub->product_code, sub->assign_activate);
    for (unsigned int s = 0; sub->syncs[s].index != 0xff; s++) {
        printf("sm %u %d %u\n", sub->syncs[s].index, (int)sub->syncs[s].dir, sub->syncs[s].n_pdos);
        for (unsigned int p = 0; p < sub->syncs[s].n_pdos; p++)
            for (unsigned int e = 0; e < sub->syncs[s].pdos[p].n_entries; e++)
                printf("%x %x:%u %u\n", sub->syncs[s].pdos[p].index,
                       sub->syncs[s].pdos[p].entries[e].index,
                       sub->syncs[s].pdos[p].entries[e].subindex,
                       sub->syncs[s].pdos[p].entries[e].bit_length);
    }
}

int main(void)
{
    for (unsigned int n = 0; fsn_subdevice(n); n++)
        show(fsn_subdevice(n));
#ifdef IGH
    uint8_t image[64] = {0};
    for (unsigned int n = 0; fsn_registrations()[n].index; n++) {
        const ec_pdo_entry_reg_t *row = &fsn_registrations()[n];
        *row->offset = 8 * n;
        image[8 * n] = (uint8_t)(n + 1);
        printf("reg %u %u %x %x %x:%u\n", row->alias, row->position, row->vendor_id,
               row->product_code, row->index, row->subindex);
    }
    fsn_copy_all(image);
    printf("image %u %u %u %u\n", image[0], image[8], image[16], image[24]);
#else
    for (unsigned int n = 0; fsn_copy(n); n++)
        printf("copy %u %u %u %u %u %u %u\n", fsn_copy(n)->source.subdevice,
               fsn_copy(n)->source.sync_manager, fsn_copy(n)->source.byte,
               fsn_copy(n)->destination.subdevice, fsn_copy(n)->destination.sync_manager,
               fsn_copy(n)->destination.byte, fsn_copy(n)->bytes);
#endif
    return 0;
}
"""


def compiled(
    text: str, folder: Path, compiler: str, *, igh: bool, ask: str = ASK, old: bool = False
) -> list[str]:
    (folder / "bus.h").write_text(text, "utf-8")
    (folder / "ask.c").write_text(ask, "utf-8")
    call = [compiler, *FLAGS, "-I", str(folder), str(folder / "ask.c"), "-o", str(folder / "ask")]
    if igh:
        call += ["-I", str(FAKE), "-DIGH"] + ["-DECRT_OLD"] * old
    done = subprocess.run(call, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    ran = subprocess.run([str(folder / "ask")], capture_output=True, text=True, check=True)
    return ran.stdout.splitlines()


def header(description: Description, *, igh: bool) -> str:
    return write_c_header(description, igh=igh, file="bus.h").files["bus.h"]


def expected(description: Description) -> list[str]:
    rows = []
    for sub in description.subdevices:
        device = sub.device
        rows.append(
            f"sub {sub.name} {sub.alias} {sub.position} {device.vendor_id:x} "
            f"{device.product_code:x} {device.assign_activate:x}"
        )
        for manager in device.layout.managers:
            sm = manager.sm
            number = 1 if sm.direction is Direction.OUTPUT else 2
            rows.append(f"sm {sm.index} {number} {len(device.pdos_of(sm))}")
            for pdo in device.pdos_of(sm):
                rows += [f"{pdo.index:x} {e.index:x}:{e.subindex} {e.bits}" for e in pdo.entries]
    return rows


@pytest.mark.parametrize("igh", [True, False], ids=["igh", "plain"])
@pytest.mark.parametrize("compiler", COMPILERS)
def test_a_compiled_program_sees_the_bus(compiler: str, igh: bool, tmp_path: Path):
    network = describe(example("estop").network)
    found = compiled(header(network, igh=igh), tmp_path, compiler, igh=igh)
    wanted = expected(network)
    assert found[: len(wanted)] == wanted
    assert found[len(wanted) :] == (
        [
            "reg 0 0 2 77a2c52 6000:1",
            "reg 0 1 2 77e3052 7080:1",
            "reg 0 1 2 77e3052 6080:1",
            "reg 0 0 2 77a2c52 7000:1",
            "image 1 1 3 3",
        ]
        if igh
        else ["copy 0 3 0 1 2 0 6", "copy 1 3 0 0 2 0 6"]
    )


@pytest.mark.parametrize("igh", [True, False], ids=["igh", "plain"])
@pytest.mark.parametrize("compiler", COMPILERS)
def test_tables_no_one_uses_are_not_warning(compiler: str, igh: bool, tmp_path: Path):
    ask = '#include "bus.h"\nint main(void)\n{\n    return 0;\n}\n'
    text = header(describe(example("el6910").network), igh=igh)
    assert compiled(text, tmp_path, compiler, igh=igh, ask=ask) == []
    if igh:
        assert compiled(text, tmp_path, compiler, igh=igh, ask=ask, old=True) == []


@pytest.mark.parametrize("igh", [True, False], ids=["igh", "plain"])
@pytest.mark.parametrize("compiler", COMPILERS)
def test_a_bus_without_anything(compiler: str, igh: bool, tmp_path: Path):
    ask = '#include "bus.h"\nint main(void)\n{\n    return fsn_subdevice(0) != NULL;\n}\n'
    nothing = Description(format="t", path="")
    assert compiled(header(nothing, igh=igh), tmp_path, compiler, igh=igh, ask=ask) == []


def back(text: str) -> Description:
    out = Collector()
    found = load_igh_text(text.encode(), out, name="bus.h")
    assert [(d.code, d.message, d.span.line) for d in out.diagnostics] == []
    assert found is not None
    return found


def tables(device: Device) -> list[object]:
    rows = []
    for sm in sorted(device.sync_managers, key=lambda s: s.index):
        pdos = [
            (p.index, [(e.index, e.subindex, e.bits) for e in p.entries])
            for p in device.pdos_of(sm)
        ]
        if pdos or sm.index > 1:
            rows.append((sm.index, sm.direction, sm.watchdog, pdos))
    return rows


@pytest.mark.parametrize("igh", [True, False], ids=["igh", "plain"])
@pytest.mark.parametrize("wanted", [describe(example("el6910").network), bus(12)])
def test_a_header_is_read_back(wanted: Description, igh: bool):
    found = back(header(wanted, igh=igh))
    assert [s.position for s in found.subdevices] == [s.position for s in wanted.subdevices]
    assert [s.revision for s in found.subdevices] == [s.revision for s in wanted.subdevices]
    for one, other in zip(found.subdevices, wanted.subdevices, strict=True):
        assert one.device.vendor_id == other.device.vendor_id
        assert one.device.product_code == other.device.product_code
        assert tables(one.device) == tables(other.device)


@settings(max_examples=examples(60), deadline=None)
@given(described_devices(sdos=False))
def test_any_device_is_read_back(sub: DescribedSubDevice):
    one = Description(format="t", path="", subdevices=(replace(sub, position=3),))
    found = back(header(one, igh=True)).subdevices[0]
    assert found.position == 3
    assert tables(found.device) == tables(sub.device)


HOSTILE = 'a */ int x; /* ??/ \\ " %s ü \n#error'


@pytest.mark.parametrize("compiler", COMPILERS)
def test_names_cannot_leave_their_place(compiler: str, tmp_path: Path):
    pdo = Pdo(index=0x1600, entries=(entry(0x7000, 1, 8, HOSTILE),), name=HOSTILE)
    sm = SyncManager(index=2, direction=Direction.OUTPUT, pdos=(pdo,))
    made = Device(path="", vendor_id=1, product_code=2, sync_managers=(sm,))
    sub = DescribedSubDevice(name=HOSTILE, order=HOSTILE, position=0, device=made)
    text = header(Description(format="t", path="", subdevices=(sub,)), igh=False)
    found = compiled(text, tmp_path, compiler, igh=False)
    assert found[0] == f"sub {HOSTILE.replace(chr(10), ' ')} 0 0 1 2 0"
    assert tables(back(text).subdevices[0].device) == tables(made)


def test_copies_of_parts_of_bytes_are_refused():
    made = bus(1)
    for igh in (True, False):
        with pytest.raises(InputError, match="parts of bytes"):
            header(replace(made, copies=(copy((0, 3, 0), (1, 2, 0), 4),)), igh=igh)
        with pytest.raises(InputError, match="past what is known"):
            header(replace(made, copies=(copy((0, 3, 0), (1, 2, 0), 800),)), igh=igh)


def test_values_that_a_header_cannot_hold_are_reported():
    written = write_c_header(bus(1))
    assert "logic: start-up SDOs are not in this file" in written.notes
    assert "the cycle is not in this file" in written.notes
    network = describe(example("estop").network)
    assert any("watchdogs" in n for n in write_c_header(network).notes)
