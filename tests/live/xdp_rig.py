"""`fsn-master --xdp` on a wire, in a network namespace: prints what was seen as JSON.

Run as a program: ``xdp_rig.py CASE NETWORK``.
"""

from __future__ import annotations

import ctypes
import json
import os
import platform
import signal
import socket
import struct
import subprocess
import sys

from live.live_rig import FSN, Emulator, wait_for

from fsoe_net.errors import FsnError
from fsoe_net.live.client import Client
from fsoe_net.live.master import find_master

PROG_LOAD, LINK_CREATE, PROG_TYPE_XDP, ATTACH_XDP = 5, 28, 6, 37
SYS_BPF = {"x86_64": 321, "aarch64": 280}
PASSES_ALL = struct.pack("<BBhiBBhi", 0xB7, 0, 0, 2, 0x95, 0, 0, 0)  # r0 = XDP_PASS; exit


def command(network, *options, interface="near", socket="socket"):
    subprocess.run([*FSN, "plan", network, "-o", "plan", "--overwrite"], check=True)
    return [find_master(), "plan", "--interface", interface, "--socket", socket, *options]


def ended(words):
    """Exit code and words of a process that ends by itself."""
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    return {"code": done.returncode, "said": done.stderr}


def program_of(interface):
    shown = subprocess.run(["ip", "-d", "link", "show", interface], capture_output=True, text=True)
    return "fsn_cyclic" in shown.stdout


def connect():
    try:
        return Client("socket")
    except FsnError:
        return None


def in_data(client):
    try:
        seen = client.snapshot()
    except FsnError:
        return None
    return all(c.state.startswith("data") for c in seen.cycle.connections) and seen


def killed(network):
    """The program goes with the process, even by SIGKILL; the next start has the bus again."""
    emulator = Emulator(network)
    seen = []
    for _ in range(2):
        with subprocess.Popen(command(network, "--xdp")) as master:
            client = wait_for("the socket", connect)
            wait_for("Data", lambda c=client: in_data(c))
            seen.append(program_of("near"))
            master.kill()
        wait_for("its end", lambda: not program_of("near"))
        os.unlink("socket")
    emulator.end()
    return seen


def interface_down(network):
    """Frames that are not sent are counted; the bus continues when the interface is up again."""
    emulator = Emulator(network)
    with subprocess.Popen(command(network, "--xdp")) as master:
        client = wait_for("the socket", connect)
        wait_for("Data", lambda: in_data(client))
        before = client.snapshot().cycle.statistics
        subprocess.run(["ip", "link", "set", "near", "down"], check=True)
        wait_for("a reset", lambda: not in_data(client))
        subprocess.run(["ip", "link", "set", "near", "up"], check=True)
        after = wait_for("Data again", lambda: in_data(client)).cycle.statistics
        master.send_signal(signal.SIGINT)
    emulator.end()
    return {
        "code": master.returncode,
        "unsent": after.unsent_frames - before.unsent_frames,
        "lost": after.lost_frames - before.lost_frames,
    }


def takes_no_successor(network):
    emulator = Emulator(network)
    with subprocess.Popen(command(network, "--xdp")) as master:
        client = wait_for("the socket", connect)
        wait_for("Data", lambda: in_data(client))
        seen = ended(command(network, "--take-over", socket="other"))
        running = in_data(client) is not None
        master.send_signal(signal.SIGINT)
    emulator.end()
    return seen | {"running": running}


def captured(network):
    emulator = Emulator(network)
    with subprocess.Popen(command(network, "--xdp")) as master:
        client = wait_for("the socket", connect)
        wait_for("Data", lambda: in_data(client))
        words = ["monitor", "--socket", "socket", "--duration", "1s", "--capture", "a.pcapng"]
        seen = ended([*FSN, *words])
        master.send_signal(signal.SIGINT)
    emulator.end()
    return seen


def bpf(number, attributes):
    libc = ctypes.CDLL(None, use_errno=True)
    room = ctypes.create_string_buffer(attributes.ljust(128, b"\0"))
    made = libc.syscall(SYS_BPF[platform.machine()], number, room, 128)
    if made < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return made


def taken_by_another(network):
    code = ctypes.create_string_buffer(PASSES_ALL)
    licence = ctypes.create_string_buffer(b"none")
    load = struct.pack("=IIQQ", PROG_TYPE_XDP, 2, ctypes.addressof(code), ctypes.addressof(licence))
    program = bpf(PROG_LOAD, load)
    number = socket.if_nametoindex("near")
    bpf(LINK_CREATE, struct.pack("=IIII", program, number, ATTACH_XDP, 0))
    return ended(command(network, "--xdp"))


def several_queues(network):
    pair = "near3 numrxqueues 2 numtxqueues 2 type veth peer name far3"
    subprocess.run(["ip", "link", "add", *pair.split()], check=True)
    for end in ("near3", "far3"):
        subprocess.run(["ip", "link", "set", end, "up"], check=True)
    return ended(command(network, "--xdp", interface="near3"))


def without_capabilities(network):
    limit = "--bounding-set=-all,+net_raw,+sys_nice,+ipc_lock"
    return ended(["setpriv", limit, *command(network, "--xdp")])


CASES = {
    case.__name__: case
    for case in (
        *(killed, interface_down, takes_no_successor, captured),
        *(taken_by_another, several_queues, without_capabilities),
    )
}

if __name__ == "__main__":
    sys.stdout.write(json.dumps(CASES[sys.argv[1]](sys.argv[2])) + "\n")
