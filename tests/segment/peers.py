"""Other people's MainDevices against our segment, in a network namespace of their own.

Run as a program: ``peers.py soem|clocks|kickcat[-ring|-gap] NETWORK``, with two cables to the
segment, and a gap behind the first SubDevice; prints what the MainDevice saw as JSON. The
relay copies every frame of the plan from inputs to outputs, as any black channel does.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time

from patience import PATIENCE_S

from fsoe_net.core.segment import Segment, SegmentLink
from fsoe_net.errors import EnvironmentFault
from fsoe_net.formats.own.network import load_network
from fsoe_net.model.resolve import resolve
from fsoe_net.plan.codec import decode_plan
from fsoe_net.plan.compile import compile_plan
from fsoe_net.simulate.emulate import SegmentSession
from fsoe_net.simulate.session import counted_session_ids

NO_FRAME = -1  # of SOEM: nothing came back in time


class Devices:
    """The devices of a network, stepped in a thread."""

    def __init__(self, network, second):
        loaded = load_network([network])
        resolution = resolve(loaded.network)
        data = compile_plan(resolution).to_bytes()
        self.plan = decode_plan(data)
        self.session = SegmentSession(resolution, data, None, session_ids=counted_session_ids())
        self.segment: Segment = self.session.segment
        try:  # a MainDevice that polls takes milliseconds for a lost frame
            self.segment.link(SegmentLink(interface="far", interface2=second, priority=20))
        except EnvironmentFault:
            self.segment.link(SegmentLink(interface="far", interface2=second))
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self):
        start = time.monotonic_ns()
        while not self._stop.wait(0.0005):
            self.session.step_devices(time.monotonic_ns() - start)

    def end(self):
        self._stop.set()
        self._thread.join()
        self.segment.unlink()

    def position(self, sm):
        return self.segment.position(
            self.plan.subdevices[self.plan.sync_managers[sm].subdevice].name
        )

    def in_data(self):
        ends = [*self.session.network.mains.values(), *self.session.network.subs.values()]
        return all(port.instance.data_valid for port in ends)


def relay(devices):
    """Return the copies of the plan: ring position and byte of source and destination, size."""
    return [
        (
            devices.position(c.source_sm),
            c.source_bit // 8,
            devices.position(c.destination_sm),
            c.destination_bit // 8,
            c.size_bytes,
        )
        for c in devices.plan.copies
    ]


def soem(devices, second=None):
    import pysoem

    master = pysoem.Master()
    master.open("near", second)
    seen = {"found": master.config_init()}
    if seen["found"] != devices.segment.size:
        sys.exit(f"found {seen['found']} SubDevices")
    seen["identities"] = [[s.name, s.man, s.id] for s in master.slaves]
    master.config_map()
    seen["sizes"] = [[len(s.output), len(s.input)] for s in master.slaves]
    seen["safeop"] = master.state_check(pysoem.SAFEOP_STATE, 20_000_000)
    seen["vendor"] = int.from_bytes(master.slaves[-1].sdo_read(0x1018, 1), "little")
    master.send_processdata()
    master.receive_processdata(2000)
    master.state = pysoem.OP_STATE
    master.write_state()
    copies = relay(devices)
    outputs = {n: bytearray(len(s.output)) for n, s in enumerate(master.slaves)}
    end = time.monotonic() + PATIENCE_S
    rounds = back = good = 0
    states = []
    while not (good > 200 and set(states) == {pysoem.OP_STATE} and devices.in_data()):
        if time.monotonic() > end:
            sys.exit(f"never all in OP and in Data at once: {states}")
        for source, at, destination, to, size in copies:
            outputs[destination][to : to + size] = master.slaves[source].input[at : at + size]
        for n, data in outputs.items():
            master.slaves[n].output = bytes(data)
        master.send_processdata()
        counted = master.receive_processdata(2000)
        back += counted != NO_FRAME  # a busy machine brings some too late
        good += counted == master.expected_wkc
        rounds += 1
        if rounds % 50 == 0:
            master.read_state()
            states = [s.state for s in master.slaves]
            ask_for_op(master)
        time.sleep(0.0005)
    # Once nothing is copied any more, it is over soon: this was so at the end of the loop.
    seen |= {"in_data": True, "states": states, "good": good / back}
    master.close()
    return seen


def ask_for_op(master):
    """Bring back who has left OP: a busy machine is too late for a watchdog now and then."""
    import pysoem

    for each in master.slaves:
        if each.state != pysoem.OP_STATE:
            failed = each.state & pysoem.STATE_ERROR
            each.state = pysoem.SAFEOP_STATE | pysoem.STATE_ACK if failed else pysoem.OP_STATE
            each.write_state()


def clocks(devices):
    """SOEM starts SYNC0 of the last SubDevice on clocks that nobody sets, then sets them."""
    import pysoem

    master = pysoem.Master()
    master.open("near")
    seen = {"found": master.config_init()}
    master.config_map()
    last = master.slaves[-1]
    last.dc_sync(True, 1_000_000)

    def reach_op():
        last.state = pysoem.SAFEOP_STATE | pysoem.STATE_ACK
        last.write_state()
        last.state_check(pysoem.SAFEOP_STATE, 2_000_000)
        last.state = pysoem.OP_STATE
        last.write_state()
        for _ in range(400):  # with clocks SOEM adds the time to each of them
            master.send_processdata()
            master.receive_processdata(2000)
            time.sleep(0.0005)
        master.read_state()
        return {"state": last.state, "code": last.al_status}

    master.state_check(pysoem.SAFEOP_STATE, 2_000_000)
    seen["unset"] = reach_op()
    seen["has_clocks"] = bool(master.config_dc())
    last.dc_sync(True, 1_000_000)
    end = time.monotonic() + PATIENCE_S
    seen["set"] = reach_op()
    while seen["set"]["state"] != pysoem.OP_STATE and time.monotonic() < end:
        seen["set"] = reach_op()
    master.close()
    return seen


def kickcat(devices, second=""):
    import kickcat as kick

    bus = kick.Bus(kick.create_link("near", second))
    bus.init(0.1)
    slaves = list(bus.slaves())
    seen = {"found": len(slaves)}
    bus.create_mapping()
    seen["sizes"] = [[s.output_size, s.input_size] for s in slaves]
    bus.request_state(kick.State.SAFE_OP)
    bus.wait_for_state(kick.State.SAFE_OP, PATIENCE_S)
    outputs = {n: bytearray(s.output_size) for n, s in enumerate(slaves)}
    copies = relay(devices)

    def cycle():
        for source, at, destination, to, size in copies:
            inputs = bytes(slaves[source].input_data)
            outputs[destination][to : to + size] = inputs[at : at + size]
        for n, data in outputs.items():
            if data:
                slaves[n].set_output_bytes(bytes(data))
        bus.process_data()

    cycle()
    bus.request_state(kick.State.OPERATIONAL)
    bus.wait_for_state(kick.State.OPERATIONAL, PATIENCE_S, cycle)
    end = time.monotonic() + PATIENCE_S
    states = []
    while not (set(states) == {"OP"} and devices.in_data()):
        if time.monotonic() > end:
            sys.exit(f"never all in OP and in Data at once: {states}")
        cycle()
        states = [devices.segment.al_status(n).state for n in range(devices.segment.size)]
        time.sleep(0.0005)
    # Once nothing is copied any more, it is over soon: this was so at the end of the loop.
    return seen | {"in_data": True, "states": states}


def main() -> None:
    # On one CPU an answer is there at once; on two, waking the other takes too long now and then.
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    peer, _, cabling = sys.argv[1].partition("-")
    devices = Devices(sys.argv[2], "far2" if cabling else None)
    try:
        if cabling == "gap":
            devices.segment.set_link(0, False)
        masters = {"soem": soem, "clocks": clocks, "kickcat": kickcat}
        seen = masters[peer](devices, *["near2"] if cabling else [])
        counts = devices.segment.counts()
        seen["foreign"] = counts.foreign
        seen["frames"] = counts.frames
    finally:
        devices.end()
    sys.stdout.write(json.dumps(seen) + "\n")


if __name__ == "__main__":
    main()
