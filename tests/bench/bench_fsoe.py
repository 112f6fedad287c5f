"""Measures the Python FSoE engine: cycles per second, and against `fsoe_master` when installed.

A cycle is a call of the main and one of the sub, each with a new frame, in Data with ProcessData.
The rounds of all contestants alternate, so that a busy machine slows all of them; the best of each
counts. `main/s` counts only the time inside the calls of the main.
"""

from __future__ import annotations

import importlib
import sys
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from fsoe.foreign import MODULE, ForeignMain
from fsoe.pair import Bench, make_sub

from fsoe_net.fsoe.event import State

LIMIT_PER_S = 20_000
SIZES = (1, 2, 6, 14)
ROUNDS, CYCLES = 7, 3_000

Round = Callable[[int], tuple[float, float]]


def ours(size: int) -> Round:
    """Return a function that runs cycles; it returns seconds of all and of the main's part."""
    bench = Bench(size, size).to_data()
    main, sub = bench.main, bench.sub
    main.enable = sub.enable = True
    frame = bench.sub_turn() or bench.to_main

    def run(cycles: int) -> tuple[float, float]:
        nonlocal frame
        start = time.perf_counter()
        for _ in range(cycles):
            frame = sub.step(0, main.step(0, frame))
        whole = time.perf_counter() - start
        assert main.data_valid
        assert sub.data_valid
        alone = 0.0
        for _ in range(cycles):
            before = time.perf_counter()
            sent = main.step(0, frame)
            alone += time.perf_counter() - before
            frame = sub.step(0, sent)
        return whole, alone

    return run


def foreign(module, size: int) -> tuple[Round, Callable[[], None]]:
    """Return the same for the foreign main with our sub, and a function that ends its thread."""
    theirs = ForeignMain(module, size, size)
    main, sub = theirs.handler, make_sub(size, size)
    main.start()
    while sub.state is not State.DATA:
        answer = sub.step(0, bytes(main.get_request()))
        if answer is not None:
            main.set_reply(answer)
    main.set_fail_safe(False)
    sub.enable = True

    def run(cycles: int) -> tuple[float, float]:
        start = time.perf_counter()
        for _ in range(cycles):
            main.set_reply(sub.step(0, main.get_request()))
        whole = time.perf_counter() - start
        assert sub.data_valid
        alone = 0.0
        for _ in range(cycles):
            before = time.perf_counter()
            sent = main.get_request()
            alone += time.perf_counter() - before
            answer = sub.step(0, sent)
            before = time.perf_counter()
            main.set_reply(answer)
            alone += time.perf_counter() - before
        return whole, alone

    for _ in range(4):
        main.set_reply(sub.step(0, main.get_request()))
    return run, main.delete


def best(contestants: list[Round]) -> list[tuple[float, float]]:
    """Return cycles per second and steps of the main per second of each."""
    seconds: list[list[tuple[float, float]]] = [[] for _ in contestants]
    for _ in range(ROUNDS):
        for run, kept in zip(contestants, seconds, strict=True):
            kept.append(run(CYCLES))
    return [
        (CYCLES / min(whole for whole, _ in kept), CYCLES / min(alone for _, alone in kept))
        for kept in seconds
    ]


def foreign_module():
    try:
        return importlib.import_module(MODULE)
    except ImportError:
        return None


def main() -> None:
    module = foreign_module()
    print(f"\n{'safe bytes':<12}{'cycles/s':>10}{'main/s':>10}", end="")
    print(f"{'theirs':>12}{'ratio':>8}{'their main':>12}{'ratio':>8}" if module else "")
    for size in SIZES:
        if module is None:
            ((rate, step),) = best([ours(size)])
            print(f"{size:<12}{rate:>10.0f}{step:>10.0f}")
        else:
            run, end = foreign(module, size)
            (rate, step), (other_rate, other_step) = best([ours(size), run])
            end()
            print(f"{size:<12}{rate:>10.0f}{step:>10.0f}{other_rate:>12.0f}", end="")
            print(f"{rate / other_rate:>8.1f}{other_step:>12.0f}{step / other_step:>8.1f}")
        if size == 1:
            at_limit = rate / LIMIT_PER_S
    print(f"1 byte against the limit of {LIMIT_PER_S} cycles/s: {at_limit:.1f} times")
    if module is None:
        print("fsoe_master is not installed (extra `interop`): no ratio to it")
    else:
        print("theirs: fsoe_master with our sub; wanted: ratio 2")


if __name__ == "__main__":
    main()
