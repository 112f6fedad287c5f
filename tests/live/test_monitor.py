"""`fsoe-net monitor`: against a server that answers as told, and beside a live bus."""

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import pytest
from capture.tshark import tshark
from capture_file import read_capture
from cli.tool import fsn
from live.on_the_wire import ESTOP, on_the_wire
from live.support import EXAMPLES, ROOT, needs_core
from live.watched_master import MS, WatchedMaster, direction, subdevice
from tied import tied

from fsoe_net.capture.wire import RebuiltFrames
from fsoe_net.errors import EnvironmentFault
from fsoe_net.live.attachment import Attachment
from fsoe_net.live.live_capture import LiveCapture
from fsoe_net.live.packet_socket import PacketSocket
from fsoe_net.report.cycle_times import timing_bars

LRW_AT, HEAD = 14 + 2, 10  # first datagram of a frame, its header


@pytest.fixture
def master():
    folder = Path(tempfile.mkdtemp(prefix="fsn-"))  # the path of a socket must be short
    server = WatchedMaster(folder / "s")
    yield server
    server.close()
    shutil.rmtree(folder)


def monitor(master, *words):
    return fsn("monitor", "--socket", str(master.path), *words)


def test_once_shows_what_is_known(master):
    client = {"client": 4, "outputs": 1, "misses": 5, "state": "late", "torn": 0}
    master.in_cycle = [client | {"on_time": 9, "late": 1, "missed": 2}]
    done = monitor(master, "--once")
    assert (done.returncode, done.stderr) == (0, "")
    for text in (
        "soem on no-such-if · running",
        "cycle 1000",
        "Data · ProcessData",
        "90 % of 100 ms",
        "wake-up latency",
        "1000 cycles, 0 with incomplete working counter",
        "client 4 in the cycle: late, 1 output; sent 9 times in time, 1 late; 2 cycles without",
    ):
        assert text in done.stdout
    assert "not known" not in done.stdout
    assert "\x1b" not in done.stdout


def test_the_document_states_the_same(master):
    master.wire |= {"to_main": direction(resets=2)}
    done = monitor(master, "--once", "--format", "json")
    found = json.loads(done.stdout)
    assert (done.returncode, found["result"], found["state"]) == (0, "pass", "running")
    (row,) = found["connections"]
    assert (row["watchdog_share"], row["held_main"], row["held_sub"]) == (0.9, 2, 2)
    assert (row["silent_to_sub_ms"], row["resets_to_sub"], row["watchdog_ms"]) == (5, 1, 100)
    assert row["resets_to_main"] == 2
    assert row["fsoe_cycle_ms"] == {"last": 4, "min": 3, "mean": 4, "max": 90}
    assert row["cause"].startswith("both ends sent: local reset")
    page = (ROOT / "docs/reference/json-output.md").read_text("utf-8")
    keys = {*found, "file", "rebuilt", "frames", "missed", "fault"} | set(row)
    pages = page + (ROOT / "docs/reference/run-output.md").read_text("utf-8")
    assert [k for k in sorted(keys) if f"`{k}`" not in pages] == []


def test_a_master_without_layout_has_no_watchdogs(master):
    master.known -= {"layout"}
    assert "not known" in monitor(master, "--once").stdout


def test_errors_are_named(master):
    master.wire |= {
        "observed_state": 1,
        "to_main": direction(command=0x2A, resets=2, reset_code=5, wrong=3),
    }
    gone = subdevice("drive", al="none", detail="the link after logic is down")
    master.subdevices = [subdevice("logic", link_lost=[0, 4], rx_errors=[9, 0], returns=2), gone]
    done = monitor(master, "--once")
    assert done.returncode == 1
    for text in (
        "Reset",
        "SubInstance sent: watchdog expired",
        "drive: no answer: the link after logic is down",
        "logic: lost and back 2 times, link lost (port 1: 4), receive errors (port 0: 9)",
    ):
        assert text in done.stdout


def test_a_stopped_bus_is_reported(master):
    master.state = "stopped"
    done = monitor(master, "--once")
    assert (done.returncode, "the bus does not run (stopped)" in done.stdout) == (1, True)
    found = json.loads(monitor(master, "--once", "--format", "json").stdout)
    assert (found["current"], found["statistics"], found["connections"]) == (False, None, [])


def test_events_tell_who_began(master):
    with Attachment(master.path) as attached:
        attached.look(0.0)
        master.wire |= {"to_main": direction(command=0x2A, resets=2, reset_code=5)}
        master.tell(
            event="connection", now_ns=1, connection="c1", before="process data", after="reset",
            reset_by="sub", reset_code=5, reset_text="watchdog expired",
        )  # fmt: skip
        view = attached.look(0.0)
        while not view.events:
            view = attached.look(0.1)
    assert view.events[0].text == "SubInstance resets: watchdog expired"
    assert view.connections[0].cause == "SubInstance: watchdog expired"
    assert view.connections[0].result.resets == 2  # the larger of both ends


def test_a_master_that_goes_and_comes_back(master):
    with Attachment(master.path) as attached:
        assert attached.look(0.0).good
        master.close()
        view = attached.look(0.01)
        assert "has closed it" in view.away
        assert not view.good
        assert view.snapshot is not None  # what was seen last
        assert attached.look(0.01).away == view.away  # told once
        master.wire["observed_state"] = 5
        master.reopen()
        view = attached.look(0.01)
        assert (view.away, view.connections[0].result.state) == ("", "data_failsafe")
    texts = [e.text for e in view.events]
    assert [t.partition(":")[0].partition(";")[0] for t in texts] == [
        "fsn-master is gone, waiting for it",
        "fsn-master answers again",
    ]
    assert view.events_lost == 1


def test_a_bus_that_stops_and_starts(master):
    with Attachment(master.path) as attached:
        assert attached.look(0.0).current
        master.state = "stopped"
        view = attached.look(0.0)
        assert (view.current, view.good, view.away) == (False, False, "")
        master.state = "running"
        assert attached.look(0.0).good


def test_events_come_as_lines_until_interrupted(master):
    process = subprocess.Popen(
        tied(sys.executable, "-m", "fsoe_net.cli", "monitor", "--socket", master.path),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    master.subscribed.wait()
    master.tell(event="state", now_ns=1, state="running", text="ready")
    assert "fsn-master: ready" in process.stdout.readline()
    process.send_signal(signal.SIGINT)
    out, err = process.communicate()
    assert (process.returncode, err) == (0, "")
    assert "c1" in out


@pytest.mark.parametrize(
    ("words", "text"),
    [
        ([], "give either --socket"),
        (["--socket", "a", "--interface", "b"], "give either --socket"),
        (["--socket", "a", "--once", "--duration", "1s"], "--once looks once"),
        (["--socket", "a", "--once", "--capture", "x"], "--once looks once"),
        (["--socket", "a", "--rebuild"], "--rebuild belongs to --capture"),
    ],
)
def test_monitor_reports_usage_errors(words, text):
    done = fsn("monitor", *words)
    assert (done.returncode, text in done.stderr) == (2, True), done.stderr


def test_monitor_reports_a_missing_socket_or_folder(tmp_path):
    done = fsn("monitor", "--socket", str(tmp_path / "none"), "--once")
    assert (done.returncode, "is fsn-master running" in done.stderr) == (3, True)
    done = fsn("monitor", "--socket", "x", "--duration", "1s", "--capture", str(tmp_path / "no/f"))
    assert (done.returncode, "missing folder" in done.stderr) == (3, True)


def images_of_a_run(folder):
    """Return packets of a virtual run, and the images its cycles left."""
    path = folder / "run.pcapng"
    done = fsn(
        *("run", str(EXAMPLES / "estop" / "network.yaml"), "--virtual-time"),
        *("--duration", "0.5", "--capture", str(path)),
    )
    assert done.returncode == 0
    packets = [data for _, data in read_capture(path)]
    images = []
    for data in packets:
        if data[6:12] != bytes.fromhex("000000000001"):
            continue
        size = int.from_bytes(data[LRW_AT + 6 : LRW_AT + 8], "little") & 0x7FF
        images.append(data[LRW_AT + HEAD : LRW_AT + HEAD + size])
    return packets, images


def layout_of(images):
    """Return a layout that fits: where a run's outputs are is told by its plan, in IgH's order."""
    from networks import example

    from fsoe_net.plan.compile import compile_plan
    from fsoe_net.plan.image import igh_image

    domain = igh_image(compile_plan(example("estop")))
    sms = [
        {
            "subdevice": "x", "sm": n, "direction": "output" if f.is_output else "input",
            "byte": f.offset_bytes, "bytes": f.size_bytes,
        }
        for n, f in enumerate(domain.fmmus)
    ]  # fmt: skip
    datagrams = [
        {"byte": d.offset_bytes, "bytes": d.size_bytes, "expected_wkc": d.working_counter}
        for d in domain.datagrams
    ]
    return {
        "image_bytes": len(images[0]), "sms": sms, "datagrams": datagrams, "copies": [],
    }, domain.working_counter  # fmt: skip


@needs_core
def test_frames_are_rebuilt_as_a_run_writes_them(tmp_path):
    packets, images = images_of_a_run(tmp_path)
    layout, wkc = layout_of(images)
    frames = RebuiltFrames(
        [(d["byte"], d["bytes"], d["expected_wkc"]) for d in layout["datagrams"]],
        [(s["byte"], s["bytes"]) for s in layout["sms"] if s["direction"] == "output"],
        layout["image_bytes"],
    )
    rebuilt = []
    for number, image in enumerate(images, 1):
        rebuilt += [data for _, data, _ in frames.cycle(image, number, number * MS, (wkc, wkc))]
    assert len(rebuilt) > 500
    assert rebuilt == packets
    # A cycle that was missed leaves out the frame that came back for it.
    assert [out for _, _, out in frames.cycle(images[0], 10**6, 0, (wkc, wkc))] == [True]
    with pytest.raises(ValueError, match="an image of 1 bytes"):
        list(frames.cycle(b"x", 1, 0, (wkc, wkc)))


@needs_core
def test_a_rebuilt_capture_is_marked_and_decodes(master, tmp_path):
    _, images = images_of_a_run(tmp_path)
    master.layout, wkc = layout_of(images)
    master.images = [
        {
            "event": "image", "cycle": n, "now_ns": n * MS, "expected_wkc": wkc, "actual_wkc": wkc,
            "image": image.hex(),
        }
        for n, image in enumerate(images, 1)
    ]  # fmt: skip
    master.images[-1]["skipped"] = 3
    path = tmp_path / "c.pcapng"
    # No interface of the bus is here, so nobody can listen on it.
    done = monitor(master, "--duration", "1s", "--capture", str(path), "--format", "json")
    assert done.returncode == 0
    assert "the capture is rebuilt from the process image: listening on no-such-if" in done.stderr
    told = json.loads(done.stdout)["capture"]
    assert told["rebuilt"].startswith("listening on no-such-if")
    assert (told["frames"], told["missed"], told["fault"]) == (2 * len(images) - 1, 3, None)
    found = json.loads(fsn("decode", str(path), "--format", "json").stdout)["sources"][0]
    assert len(found["connections"]) == 1
    assert found["connections"][0]["main_to_sub"]["wrong"] == 0
    assert found["connections"][0]["state"].startswith("data")
    read = [tshark(), "-r", str(path), "-T", "fields", "-e", "eth.type", "-e", "pkt_comment"]
    shown = subprocess.run(read, capture_output=True, text=True, check=True).stdout
    assert shown.count("0x88a4") == told["frames"]
    assert b"REBUILT by fsoe-net from the process image" in path.read_bytes()


def test_neither_wire_nor_image(master, tmp_path):
    master.known -= {"watch"}
    path = tmp_path / "c.pcapng"
    done = monitor(master, "--duration", "1s", "--capture", str(path))
    assert done.returncode == 3
    assert "no capture: listening on no-such-if" in done.stderr
    assert "no request watch" in done.stderr
    assert not path.exists()


def test_a_capture_outlives_its_master(master, tmp_path):
    master.images = []
    capture = LiveCapture(tmp_path / "c.pcapng", str(master.path), None)
    master.close()
    master.subscribed.clear()
    image = {"event": "image", "cycle": 1, "now_ns": 1, "image": "00" * 6}
    master.layout |= {"image_bytes": 6, "datagrams": [{"byte": 0, "bytes": 6}]}
    master.images = [image]
    master.reopen()
    came = threading.Event()
    while capture.packets == 0:
        came.wait(0.05)
    capture.stop()
    capture.stop()
    assert (capture.packets, capture.fault) == (1, "")
    assert len(list(read_capture(tmp_path / "c.pcapng"))) == 1


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full here")
def test_a_full_disk_ends_the_capture_only(master, tmp_path):
    master.images = [
        {"event": "image", "cycle": n, "now_ns": 1, "image": "00" * 6} for n in range(900)
    ]
    master.layout |= {"image_bytes": 6, "datagrams": [{"byte": 0, "bytes": 6}]}
    capture = LiveCapture("/dev/full", str(master.path), None)
    capture.stop()
    assert capture.fault == "No space left on device"


def test_no_such_interface():
    with pytest.raises(OSError, match=r"no interface|No such device|not permitted"):
        PacketSocket("no-such-if")


def test_bars_show_a_single_late_cycle():
    from fsoe_net.core.snapshot import Histogram

    buckets = ((1024, 1_000_000), (1500, 5), (4096, 1))
    seen = Histogram(
        count=1, min_ns=1, sum_ns=1, p50_ns=1, p99_ns=1, p999_ns=1, max_ns=1, buckets=buckets
    )
    lines = timing_bars(seen, width=10)
    assert [line.split()[0] for line in lines] == ["1.02", "2.05", "4.1"]
    assert [line.rsplit(" ", 1)[1] for line in lines] == ["1000005", "0", "1"]
    assert "█" * 10 in lines[0]
    assert set(lines[2]) & set("▏▎▍▌▋▊▉█")
    assert timing_bars(Histogram(**{**_fields(seen), "buckets": ()})) == []


def _fields(histogram):
    return {name: getattr(histogram, name) for name in histogram.__dataclass_fields__}


def test_next_to_a_live_bus(tmp_path):
    def good(found):
        return (found["once"]["code"], found["json"]["code"], found["capture"]["code"]) == (0, 0, 0)

    seen = on_the_wire("watch", ESTOP, tmp=tmp_path, good=good, script="live/monitor_rig.py")
    assert "soem on near · running" in seen["once"]["out"]
    once = json.loads(seen["json"]["out"])
    assert {s["al"] for s in once["subdevices"]} == {"OP"}
    assert once["connections"][0]["frames_to_sub"] > 10
    told = json.loads(seen["capture"]["out"])["capture"]
    assert (told["rebuilt"], told["missed"], told["fault"]) == (None, 0, None)
    done = fsn("decode", str(tmp_path / "bus.pcapng"), "--format", "json")
    (found,) = json.loads(done.stdout)["sources"]
    assert found["packets"] == told["frames"]
    assert len(found["connections"]) == 1
    check_rebuilt(seen["rebuilt"], tmp_path / "image.pcapng")
    broken = seen["broken"]
    assert broken["code"] == 1
    assert "Traceback" not in broken["err"]
    last = broken["last"]
    assert f"{last}: OP -> none" in broken["out"]
    assert f"{last}: no answer" in broken["out"]


def check_rebuilt(seen, path):
    if seen["code"] == 3:  # an fsn-master that does not know `watch`
        assert "the process image is not reported" in seen["err"]
        assert not path.exists()
        return
    assert "frames, rebuilt: as requested" in seen["out"]
    done = fsn("decode", str(path), "--format", "json")
    (found,) = json.loads(done.stdout)["sources"]
    assert len(found["connections"]) == 1
    assert found["malformed_frames"] == 0


def test_a_live_bus_that_comes_and_goes(tmp_path):
    seen = on_the_wire("comes_and_goes", ESTOP, tmp=tmp_path, script="live/monitor_rig.py")
    assert (seen["code"], seen["err"]) == (1, "")
    assert "fsn-master does not answer" in seen["out"]


def test_fallback_needs_a_process_image(master, tmp_path):
    master.known -= {"layout"}
    with pytest.raises(EnvironmentFault, match="no capture: no socket sees"):
        LiveCapture(tmp_path / "c", str(master.path), None)
