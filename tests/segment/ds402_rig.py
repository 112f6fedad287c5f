"""KickCAT's DS402 class against our drive: ``ds402_rig.py PEER NETWORK [COMMAND]``, in a namespace.

COMMAND is done by the emulator before the MainDevice starts. Prints what that saw as JSON.
"""

import subprocess
import sys

from live.live_rig import Emulator

COUNTS_PER_REV = 65536


def main(peer, network, *commands):
    emulator = Emulator(network, "--priority", "20")
    for command in commands:
        emulator.do(command)
    done = subprocess.run(
        [peer, "near", str(COUNTS_PER_REV)], capture_output=True, text=True, check=False
    )
    emulator.end()
    if done.returncode:
        sys.exit(done.stderr)
    sys.stdout.write(next(line for line in done.stdout.splitlines() if line.startswith("{")))


if __name__ == "__main__":
    main(*sys.argv[1:])
