"""A run beside a made-up fsn-master."""

from __future__ import annotations

from networks import example

from fsoe_net.errors import InputError
from fsoe_net.live.client import Client
from fsoe_net.live.live_bus import BusOptions
from fsoe_net.live.master import MasterLog
from fsoe_net.plan.compile import compile_plan
from fsoe_net.testing.fake_master import FakeMaster

RESOLUTION = example("estop")
PLAN = compile_plan(RESOLUTION).to_bytes()
OPTIONS = BusOptions(backend="soem", interface="eth1")


class Process:
    """Stands for the process: connects to the fake one."""

    def __init__(self, fake: FakeMaster) -> None:
        self.fake = fake
        self.has_ended = False
        self.words: list[str] = []

    def __call__(self, plan: bytes, words: list[str]) -> Process:
        assert plan == PLAN
        self.words = words
        return self

    def __enter__(self) -> Process:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def connect(self) -> Client:
        return Client(self.fake.path)

    def ended(self, _wait_s: float) -> bool:
        return self.has_ended

    log = MasterLog(subdevices=("ek1914",))

    def explain(self) -> None:
        raise InputError("SubDevice 0 (ek1914) is missing")
