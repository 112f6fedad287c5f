"""The robot cell with listeners at both ends of its cable: what is on the wire, and where."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import asdict
from pathlib import Path

from networks import EXAMPLES
from tied import tied

import fsoe_net


def layout_of(socket):
    """Return where its plan has copies, once ``fsn-master`` answers there."""
    while True:
        try:
            with fsoe_net.connect(socket) as client:
                return client.layout()
        except fsoe_net.FsnError:
            time.sleep(0.1)


def main(folder):
    found = {}
    listeners = [  # an end of the cable shows what arrives there
        subprocess.Popen(tied("dumpcap", "-q", "-P", "-i", end, "-w", folder / f"{end}.pcap"))
        for end in ("near", "far")
    ]
    while not all((folder / f"{end}.pcap").exists() for end in ("near", "far")):
        assert all(listener.poll() is None for listener in listeners)
        time.sleep(0.01)

    def look():
        while not (sockets := list(Path(os.environ["TMPDIR"]).glob("*/cell.sock"))):
            time.sleep(0.1)
        found["layout"] = asdict(layout_of(sockets[0]))

    threading.Thread(target=look, daemon=True).start()
    command = [sys.executable, EXAMPLES / "robot-cell" / "cell.py", folder]
    environment = os.environ | {"ROBOT_CELL_NAMESPACE": "1"}  # this one is it
    code = subprocess.run(command, env=environment, check=False).returncode
    for listener in listeners:
        listener.send_signal(signal.SIGINT)
        listener.wait()
    (folder / "layout.json").write_text(json.dumps(found), "utf-8")
    sys.exit(code)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
