"""An axis by CiA 402 in the cycle of fsn-master: up, a small move there and back, down.

    move_axis.py SOCKET SUBDEVICE STEP CYCLES

It moves a real axis: who runs it has made sure that nobody can be hurt.
"""

import sys

import fsoe_net
from fsoe_net.live.axis import AxisMode, AxisPhase


def main(socket: str, subdevice: str, step: int, cycles: int) -> int:
    with (
        fsoe_net.connect(socket) as client,
        client.realtime(f"{subdevice}.*", misses=100) as rt,
    ):
        axis = rt.axis(subdevice, mode=AxisMode.CSP, max_step=abs(step), answer_s=0.5)
        way = [step] * cycles + [-step] * cycles
        axis.enable()
        while axis.phase in (AxisPhase.OFF, AxisPhase.ENABLING, AxisPhase.ENABLED):
            rt.wait()
            if axis.enabled and way:
                axis.set_position(axis.target_position + way.pop(0))
            elif axis.enabled:
                axis.disable()
            axis.step()
            rt.send()
            if axis.phase is AxisPhase.OFF and not way:
                break
        while axis.phase is AxisPhase.STOPPING:
            rt.wait()
            axis.step()
            rt.send()
        # Whatever stopped it before its end: nothing here enables it again.
        print(f"{axis.phase.name}, drive {axis.state.name}, at {axis.position}")
        return 0 if axis.phase is AxisPhase.OFF else 1


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])))
    except fsoe_net.FsnError as exc:
        sys.exit(f"move_axis: {exc}")
