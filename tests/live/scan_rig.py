"""Inside a network namespace: an emulated segment that is changed, and a scan after each change.

``scan_rig.py steps|attached NETWORK [COMMANDS…]``: each of COMMANDS is lines of the emulator,
separated by ``;``. Prints the documents of `check --format json`, one for each, as a JSON list.
"""

from __future__ import annotations

import json
import subprocess
import sys

from live.live_rig import FSN, Emulator, Running


def check(network, *options):
    done = subprocess.run(
        [*FSN, "check", network, "--interface", "near", "--format", "json", *options],
        capture_output=True,
        text=True,
        check=False,
        stdin=subprocess.DEVNULL,
    )
    found = json.loads(done.stdout)["diagnostics"] if done.stdout else []
    rows = [[d["code"], d["message"], d["line"]] for d in found if d["code"].startswith("FSN5")]
    return {"code": done.returncode, "err": done.stderr, "found": rows}


def steps(network, commands):
    emulator = Emulator(network)
    seen = []
    for group in commands:
        for line in filter(None, group.split(";")):
            told = emulator.do(line)
            if "refused" in told:
                sys.exit(told)
        seen.append(check(network, "--yes"))
    scanned = subprocess.run(
        [*FSN, "scan", "--interface", "near", "--yes", "-o", "found"],
        capture_output=True,
        text=True,
        check=False,
    )
    emulator.end()
    return {"checks": seen, "scan": [scanned.returncode, scanned.stdout, scanned.stderr]}


def attached(network, _commands):
    """A check beside a run: the bus goes on."""
    emulator = Emulator(network)
    running = Running(network)
    before = running.cycles()
    seen = check(network)
    data = running.in_data() is not None
    after = running.cycles()
    running.client.request("shutdown")
    running.process.communicate()
    emulator.end()
    return seen | {"data": data, "cycles": after - before}


def main():
    case = {"steps": steps, "attached": attached}[sys.argv[1]]
    sys.stdout.write(json.dumps(case(sys.argv[2], sys.argv[3:])) + "\n")


if __name__ == "__main__":
    main()
