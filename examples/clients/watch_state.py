"""What a program of your own can do with a running fsn-master: watch_state.py SOCKET [OUTPUT].

Prints the state of the bus, sets one output to 1, follows it for 20 cycles and leaves; the output
then falls back to its stop value. Part of the black channel: no safety function.
"""

import sys

from fsoe_net import ControlRefused, FsnError, connect


def main(path: str, output: str | None) -> None:
    with connect(path) as client:
        status = client.status()
        print(f"{status.state}: {status.cycles} cycles of {status.cycle_ns / 1e6:g} ms")
        for connection in client.connections():
            print(f"{connection.name}: {connection.state}")
        if output is None:
            return
        client.set({output: 1})  # ours until we leave, or say nothing for longer than the lease
        print(f"{output} = {client.get(output).outputs[output]}")
        try:
            for seen in client.watch(output, every=10, duration_s=0.2):
                print(f"cycle {seen.cycle}: {seen.outputs[output]}, {seen.skipped} left out")
        except ControlRefused as exc:
            print(exc)  # this fsn-master cannot do it; the text says the next step


if __name__ == "__main__":
    if not 2 <= len(sys.argv) <= 3:
        sys.exit("usage: watch_state.py SOCKET [OUTPUT]")
    try:
        main(sys.argv[1], sys.argv[2] if len(sys.argv) == 3 else None)
    except FsnError as exc:
        sys.exit(str(exc))
