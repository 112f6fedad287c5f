"""What is fuzzed in Python: a body per kind of input, with good inputs to start from.

A body returns when the input was read, or refused as the interface promises: findings, or an error
it names. Whatever else comes out is a bug. No body starts a process.
"""

from __future__ import annotations

import io
import random
import re
import shutil
import struct
import tempfile
import zlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

from capture_file import read_capture
from formats import texts, twincat_text
from formats.sii_image import category, image, strings
from formats.startup import startup
from fsoe.pair import Bench
from fsoe.recorded import own_run, recording_text

from fsoe_net.campaign.recording import reader as recording_reader
from fsoe_net.campaign.recording.replay import replay
from fsoe_net.campaign.recording.rows import file_lines
from fsoe_net.capture.capture import CaptureWriter
from fsoe_net.capture.hexframes import follow_frames, parse_frames
from fsoe_net.capture.start_up import load_capture
from fsoe_net.core.core import CorePlan
from fsoe_net.core.scan import Scanner
from fsoe_net.diag.diagnostic import Span
from fsoe_net.errors import InputError, PlanFormatError, RecordingError
from fsoe_net.formats.eni.read import load_eni, load_eni_images
from fsoe_net.formats.eni.write import write_eni
from fsoe_net.formats.eni.write_copies import replace_copies
from fsoe_net.formats.esi.read import EsiChoice, load_esi
from fsoe_net.formats.igh.read import load_igh_text
from fsoe_net.formats.lcec.read import load_lcec
from fsoe_net.formats.own.scenario import load_scenario
from fsoe_net.formats.ros2 import urdf
from fsoe_net.formats.ros_slaves.read import load_ros_slaves
from fsoe_net.formats.shared.files import Collector
from fsoe_net.formats.shared.source import Source
from fsoe_net.formats.sii.read import load_sii
from fsoe_net.formats.soem.read import load_soem_text
from fsoe_net.formats.twincat.read import load_twincat
from fsoe_net.formats.twinsafe.read import load_twinsafe
from fsoe_net.model.description import Description
from fsoe_net.model.detect import detect_fsoe, near_misses
from fsoe_net.plan.codec import decode_plan, encode_plan
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.show import plan_json, plan_text
from fsoe_net.project.check import check_files, whole_network

ROOT = Path(__file__).parents[2]
ESTOP = ROOT / "examples" / "estop"
EL6910 = ROOT / "examples" / "el6910"
URDF = ROOT / "tests" / "formats" / "urdf"
ESI = URDF.with_name("esi")
CASES = ROOT / "tests" / "diagnostics" / "base"


def _check(path: Path) -> None:
    """Everything ``check``, ``plan`` and ``plan --show`` do with a file."""
    checked = check_files([str(path)])
    for diagnostic in checked.diagnostics:
        assert diagnostic.message
        assert diagnostic.span.line >= 0
    try:
        resolution = whole_network(checked, "no plan")
        plan = compile_plan(resolution)
    except InputError:
        return
    data = encode_plan(plan)
    assert decode_plan(data) == plan
    CorePlan.load(data)  # what was compiled without a finding must load


def _network(data: bytes, folder: Path) -> None:
    (folder / "network.yaml").write_bytes(data)
    _check(folder / "network.yaml")


def _other_file(data: bytes, folder: Path) -> None:
    (folder / "other.yaml").write_bytes(data)
    _check(folder / "other.yaml")


def _scenario(data: bytes, folder: Path) -> None:
    path = folder / "scenario.yaml"
    path.write_bytes(data)
    load_scenario(path)


def _no_child(path: str, out: Collector, _options: object) -> None:
    out.add("FSN119", Span(path, 1, 1), "xacro is not expanded here")


def _urdf(data: bytes, folder: Path) -> None:
    (folder / "robot.urdf").write_bytes(data)
    with mock.patch.object(urdf, "expand_xacro", _no_child):
        _check(folder / "robot.urdf")


def _plan(data: bytes, folder: Path) -> None:
    """Length and CRC are fixed: no mutation would pass them. Both readers get the same bytes."""
    if len(data) >= 32:
        data = data[:12] + struct.pack("<II", len(data), 0) + data[20:]
        data = data[:16] + struct.pack("<I", zlib.crc32(data)) + data[20:]
    try:
        plan = decode_plan(data)
    except PlanFormatError:
        plan = None
    else:
        plan_text(plan)
        plan_json(plan)
    try:
        CorePlan.load(data)
    except InputError:
        return
    assert plan is not None, "the C core loads what cannot be shown"


def _recording(data: bytes, folder: Path) -> None:
    few = mock.patch.object(recording_reader, "_MAX_SKIP_CYCLES", 20)  # else seconds for one line
    with few, suppress(RecordingError):
        replay(file_lines(io.BytesIO(data)))


def _hex(data: bytes, folder: Path) -> None:
    lines = data.decode("utf-8", "replace").splitlines()
    places = ((f"stdin:{n}", line) for n, line in enumerate(lines, 1))
    with suppress(InputError):
        for seen in follow_frames(parse_frames(places)):
            assert 0 <= seen.sequence <= 0xFFFF


def _capture(data: bytes, folder: Path) -> None:
    path = folder / "capture.pcapng"
    path.write_bytes(data)
    scanner, now_ns = Scanner(), 0
    with suppress(InputError):
        for time_ns, packet in read_capture(path):
            now_ns = max(now_ns, time_ns)
            for sighting in scanner.packet(packet, now_ns):
                assert sighting.time_ns <= now_ns
    scanner.connections()


def _judged(found: Description | None, out: Collector, *, binary: bool = False) -> None:
    """Findings have places; what was read can be placed, weighed and written."""
    for diagnostic in out.diagnostics:
        assert diagnostic.message
        assert diagnostic.hint
        assert binary or diagnostic.span.line > 0
    assert found is not None or out.diagnostics
    if found is None:
        return
    for subdevice in found.subdevices:
        for manager in subdevice.device.layout.managers:
            detect_fsoe(manager.placed, manager.sm)
            near_misses(manager.placed, manager.sm)
    with suppress(InputError):
        write_eni(found)


def _described(
    reader: Callable[[Source, Collector], Description | None],
) -> Callable[[bytes, Path], None]:
    """A reader of another tool's file."""

    def run(data: bytes, folder: Path) -> None:
        out = Collector()
        _judged(reader(data, out), out)

    return run


def _startup(data: bytes, folder: Path) -> None:
    """A capture as a description of a bus; its copies have ends in the process data."""
    out = Collector()
    found = load_capture(data, out)
    _judged(found, out, binary=True)
    for copy in () if found is None else found.copies:
        for end in (copy.source, copy.destination):
            managers = found.subdevices[end.subdevice].device.layout.managers
            assert end.sm_index in {m.sm.index for m in managers}


def _esi(data: bytes, folder: Path) -> None:
    for choice in (None, EsiChoice(product=0x10, revision=3, modules=(0xBE, None, 0xBF))):
        out = Collector()
        _judged(load_esi(data, out, choice=choice, cache=False), out)


def _sii(data: bytes, folder: Path) -> None:
    """The checksum is right or not; both go on."""
    out = Collector()
    _judged(load_sii(data, out), out, binary=True)


def _eni(data: bytes, folder: Path) -> None:
    _described(load_eni)(data, folder)
    out = Collector()
    images = load_eni_images(data, out)
    if images is None or out.diagnostics:
        return
    rows = [bits for c in images.description.copies if (bits := images.bits_of(c)) is not None]
    with suppress(InputError):
        changed = replace_copies(data, rows, header_bits=images.header_bits)
        again = load_eni_images(changed, Collector())
        assert again is not None
        assert set(again.description.copies) == set(images.description.copies)


# -- good inputs ----------------------------------------------------------------------------------


def _files(*paths: Path) -> Callable[[], list[bytes]]:
    return lambda: [path.read_bytes() for path in paths]


def _plans() -> list[bytes]:
    paths = (ESTOP / "network.yaml", EL6910 / "network.yaml")
    return [encode_plan(compile_plan(whole_network(check_files([str(p)]), "none"))) for p in paths]


def _recordings() -> list[bytes]:
    return [recording_text(own_run(cycles)[1]).encode() for cycles in (3, 14)]


def _conversation(cycles: int) -> list[bytes]:
    bench, frames = Bench(), []
    for n in range(cycles):
        bench.now_ns = n * 1_000_000
        frames += [bench.main_turn(), bench.sub_turn()]
    return [frame for frame in frames if frame]


def _hexes() -> list[bytes]:
    frames = [frame.hex() for frame in _conversation(8)]
    return [
        "\n".join(frames).encode(),
        b"# two of one end\nm 2a0000c42d0000, s 2a:00:00:c4:2d:00:00\n> 0x4e 22 11 fd dd 00 00\n",
    ]


def _packets() -> list[bytes]:
    """LRW datagrams: the frames of one connection, and the same conversation shifted by one."""
    packets, frames = [], _conversation(20)
    for n in range(1, len(frames)):
        main, sub = frames[n - n % 2], frames[n - 1 + n % 2]
        data = (main + sub + bytes(8) + frames[n]).ljust(40, b"\0")
        datagram = struct.pack("<BBIHH", 12, n & 0xFF, 0x10000, len(data), 0) + data + b"\3\0"
        head = bytes.fromhex("ffffffffffff02000000000188a4")
        packets.append(head + struct.pack("<H", 0x1000 | len(datagram)) + datagram)
    return packets


def _captures() -> list[bytes]:
    packets = _packets()
    pcap = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
    for n, packet in enumerate(packets):
        pcap += struct.pack("<IIII", n, 0, len(packet), len(packet)) + packet
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "seed.pcapng"
        with CaptureWriter(path) as writer:
            for n, packet in enumerate(packets):
                writer.packet(n * 1_000_000, packet)
        return [pcap, path.read_bytes()]


def _startups() -> list[bytes]:
    made = [startup(how="segments", cycles=4, wide=True), startup(vlan=True, count=1)]
    return [startup(cycles=60, replies_only=True), *made]


def _siis() -> list[bytes]:
    manager = struct.pack("<HHBBBB", 0x1100, 6, 0x24, 0, 1, 3)
    entries = ((0x7000, 1, 8), (0x7001, 1, 8), (0x7000, 3, 16), (0x7000, 2, 16))
    pdo = struct.pack("<HBBBBH", 0x1600, len(entries), 0, 0, 2, 0)
    for index, sub, bits in entries:
        pdo += struct.pack("<HBBBBH", index, sub, 3, 6, bits, 0)
    general = category(30, bytes([0, 0, 1, 1]) + bytes(28))
    words = strings(b"EL1", b"FSoE", b"CRC")
    return [
        image(words, general, category(40, b"\1\2"), category(41, manager), category(51, pdo)),
        image(words, general, category(60, bytes(24)), size=256),
    ]


def _texts(*texts: str) -> Callable[[], list[bytes]]:
    return lambda: [text.encode() for text in texts]


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """One kind of input.

    Attributes:
        run: Takes the input and a folder that may be written to.
        seeds: Makes the good inputs.
        beside: Folder whose files lie beside the input.
    """

    run: Callable[[bytes, Path], None]
    seeds: Callable[[], list[bytes]]
    beside: Path | None = None

    def prepare(self, folder: Path) -> None:
        """Put the files beside the input."""
        if self.beside is not None:
            shutil.copytree(self.beside, folder, dirs_exist_ok=True)


TARGETS = {
    "network": Target(
        run=_network,
        seeds=_files(ESTOP / "network.yaml", EL6910 / "network.yaml"),
        beside=ESTOP,
    ),
    "transfers": Target(run=_other_file, seeds=_files(ESTOP / "transfers.yaml")),
    "slave": Target(
        run=_other_file,
        seeds=_files(*sorted((*ESTOP.glob("devices/*"), *EL6910.glob("devices/*")))),
    ),
    "scenario": Target(
        run=_scenario, seeds=_files(ESTOP / "scenario.yaml", EL6910 / "scenario.yaml")
    ),
    "urdf": Target(
        run=_urdf,
        seeds=_files(URDF / "robot.urdf", ESTOP / "estop.urdf.xacro"),
        beside=ESTOP,
    ),
    "plan": Target(run=_plan, seeds=_plans),
    "recording": Target(run=_recording, seeds=_recordings),
    "hex": Target(run=_hex, seeds=_hexes),
    "capture": Target(run=_capture, seeds=_captures),
    "startup": Target(run=_startup, seeds=_startups),
    "esi": Target(run=_esi, seeds=_files(*sorted(ESI.glob("*.xml")))),
    "sii": Target(run=_sii, seeds=_siis),
    "eni": Target(run=_eni, seeds=_files(CASES / "bus.eni.xml")),
    "igh-text": Target(
        run=_described(load_igh_text),
        seeds=_texts(
            *(texts.PDOS, texts.TWO_PDOS, texts.cstruct(3, 16), texts.XML, texts.SLAVES),
            *(texts.SLAVES_V, texts.CONFIG, texts.DOMAINS),
        ),
    ),
    "soem-text": Target(run=_described(load_soem_text), seeds=_texts(texts.SOEM, texts.SOEM_MAP)),
    "lcec": Target(run=_described(load_lcec), seeds=_texts(texts.LCEC)),
    "ros-slaves": Target(run=_described(load_ros_slaves), seeds=_texts(texts.ROS_SLAVES)),
    "twinsafe": Target(
        run=_described(load_twinsafe),
        seeds=_texts(texts.TWINSAFE, twincat_text.alias(3, 5, 11, 120)),
    ),
    "twincat": Target(run=_described(load_twincat), seeds=_texts(twincat_text.machine(safety=""))),
}


# -- mutations without a fuzzer -------------------------------------------------------------------

_EDGES = (
    *(
        b"",
        b"\0",
        b"\xff",
        b"\xff\xff\xff\xff",
        b"\0\0\0\x80",
        b"-1",
        b"0",
        b"0x",
        b"65536",
        b"1e9",
    ),
    *(b"18446744073709551616", b"9" * 40, b".nan", b".inf", b"null", b"true", b"[]", b"{}", b"~"),
    *(
        b"\n",
        b"\t",
        b": ",
        b"- ",
        b"&a ",
        b"*a",
        b"!!int ",
        b"<<: ",
        b"'",
        b'"',
        b"#",
        b"</",
        b"/>",
    ),
    *(b"&amp;", b"\xc3\xa4", b"\xed\xa0\x80", b"\xe2\x80\xa8", b"\\u0000", b"\\ud800"),
)
_TOKEN = re.compile(rb"\w+")


def mutated(seed: bytes, dice: random.Random) -> bytes:
    """Return the input with one to four changes."""
    data = bytearray(seed)
    for _ in range(dice.randint(1, 4)):
        at, to = sorted((dice.randint(0, len(data)), dice.randint(0, len(data))))
        to = min(to, at + dice.choice((1, 4, 16, 200)))
        tokens = [m.span() for m in _TOKEN.finditer(data)] or [(0, 0)]
        kind = dice.randrange(7)
        if kind == 0 and data:  # a bit
            data[at % len(data)] ^= 1 << dice.randrange(8)
        elif kind == 1:  # a piece is missing
            del data[at:to]
        elif kind == 2:  # a piece twice, or elsewhere
            where = dice.randint(0, len(data))
            data[where:where] = data[at:to]
        elif kind == 3:  # an edge value instead of a piece, of the same length or not
            data[at : at + dice.choice((0, 1, 4))] = dice.choice(_EDGES)
        elif kind in (4, 5):  # a word becomes an edge value or another word
            low, high = dice.choice(tokens)
            first, last = dice.choice(tokens)
            data[low:high] = dice.choice(_EDGES) if kind == 4 else data[first:last]
        elif dice.random() < 0.2:  # cut off
            del data[at:]
    return bytes(data)
