"""Cases of `live_rig.py` with `fsoe-net monitor` beside the run, in the same namespace."""

from __future__ import annotations

import signal
import subprocess

from live.live_rig import CASES, FSN, Emulator, Running, main, wait_for


def monitor(*words):
    done = subprocess.run(
        [*FSN, "monitor", *map(str, words)], capture_output=True, text=True, check=False
    )
    return {"code": done.returncode, "out": done.stdout, "err": done.stderr}


def attached(running):
    wait_for("the monitor", lambda: running.client.request("status")["clients"] >= 3)


def until(process, text):
    """Return what it says, up to a line with this text."""
    told = ""
    for line in process.stdout:
        told += line
        if text in line:
            return told
    raise SystemExit(f"never told: {text}: {told} {process.stderr.read()}")


def watch(network, other):
    """Once, for some time, and with a capture; then a SubDevice goes."""
    emulator = Emulator(network)
    running = Running(network, "--format", "json")
    at = ("--socket", running.socket)
    seen = {"once": monitor(*at, "--once"), "json": monitor(*at, "--once", "--format", "json")}
    capture = ("--duration", "2s", "--capture", "bus.pcapng", "--format", "json")
    seen["capture"] = monitor(*at, *capture)
    seen["rebuilt"] = monitor(*at, *capture[:2], "--capture", "image.pcapng", "--rebuild")
    last = running.in_data().subdevices[-1].name
    process = subprocess.Popen(
        [*FSN, "monitor", *map(str, at)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    attached(running)
    emulator.do(f"break {last}")
    told = until(process, f"{last}: OP -> none")
    wait_for("a Reset", lambda: not running.in_data())
    process.send_signal(signal.SIGINT)
    out, err = process.communicate()
    seen["broken"] = {"code": process.returncode, "out": told + out, "err": err, "last": last}
    running.end(signal.SIGINT)
    emulator.end()
    return seen


def comes_and_goes(network, other):
    """The bus restarts, then fsn-master goes: all of it is told, nothing ends the monitor."""
    emulator = Emulator(network)
    running = Running(network)
    process = subprocess.Popen(
        [*FSN, "monitor", "--socket", str(running.socket)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    attached(running)
    running.client.request("restart")
    told = until(process, "every SubDevice is in OP")
    wait_for("Data", running.in_data)
    running.client.request("shutdown")
    told += until(process, "is gone, waiting for it")
    running.process.communicate()
    process.send_signal(signal.SIGINT)
    out, err = process.communicate()
    emulator.end()
    return {"code": process.returncode, "told": told, "out": out, "err": err}


CASES |= {f.__name__: f for f in (watch, comes_and_goes)}

if __name__ == "__main__":
    main()
