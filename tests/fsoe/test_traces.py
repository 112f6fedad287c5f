"""Recorded runs of independent implementations: fed one side's frames, our other side must answer
with the same bytes, states, reset codes and safe data, in every step, faults included."""

from __future__ import annotations

import json

import pytest
from data_files import listed, need

from fsoe_net.fsoe import EventKind, MainConfig, MainInstance, State, SubConfig, SubInstance

RUNS = listed("traces", "p*.jsonl")


class _Ids:
    """Hands out the session id the recorded implementation drew in this step."""

    def __init__(self) -> None:
        self.next: int | None = None
        self.drawn = 0

    def __call__(self) -> int:
        self.drawn += 1
        assert self.next is not None, "a session id was drawn where the recording drew none"
        return self.next


class _Side:
    """One of our ends, driven by the recording."""

    def __init__(self, name: str, config: dict) -> None:
        self.name = name
        self.ids = _Ids()
        self.verify = 0
        # Some recordings draw one constant id and do not repeat it in each step.
        constant = config["session_id_rule"].startswith("constant")
        self.constant = config[f"{name}_session_id"] if constant else None
        # `out` and `in` are the master's words.
        to_sub, to_main = config["out_size"], config["in_size"]
        if name == "master":
            self.end: MainInstance | SubInstance = MainInstance(
                MainConfig(
                    connection_id=config["connection_id"],
                    address=config["slave_address"],
                    watchdog_ms=config["watchdog_ms"],
                    safe_to_sub=to_sub,
                    safe_to_main=to_main,
                    app_parameters=bytes.fromhex(config["app_params"]),
                ),
                session_ids=self.ids,
            )
        else:
            expected = config.get("slave_app_param_size", len(config["app_params"]) // 2)
            self.end = SubInstance(
                SubConfig(
                    address=config.get("slave_own_address", config["slave_address"]),
                    safe_to_sub=to_sub,
                    safe_to_main=to_main,
                    app_parameter_bytes=expected,
                    verify=lambda _watchdog, _parameters: self.verify,
                ),
                session_ids=self.ids,
            )

    def command(self, text: str) -> None:
        what, _, value = text.partition("=")
        if what == "enable":
            self.end.enable = True
        elif what == "disable":
            self.end.enable = False
        elif what == "reset":
            self.end.request_reset()
        elif what == "verify":
            self.verify = int(value)
        elif what == "power_cycle":
            self.end.power_cycle()
        elif what not in ("data", "session"):
            raise AssertionError(f"unknown command {text}")

    def step(self, row: dict) -> dict:
        mine = "master" if self.name == "master" else "slave"
        session = row[f"{mine}_session_id"]
        self.ids.next = int(session, 16) if session is not None else self.constant
        app = row["master_app_out" if self.name == "master" else "slave_app_in"]
        self.end.set_safe_data(bytes.fromhex(app))
        received = row[f"{mine}_rx"]
        sent = self.end.step(
            row["time_us"] * 1000, None if received is None else bytes.fromhex(received)
        )
        resets = [e for e in self.end.take_events() if e.kind is not EventKind.STATE]
        return {
            "tx": sent.hex() if sent is not None else None,
            "state": self.end.state.value,
            "valid": self.end.data_valid,
            "data": self.end.received_safe_data.hex(),
            "codes": [e.code for e in resets],
        }


def _expected(row: dict, name: str) -> dict:
    return {
        "tx": row[f"{name}_tx"],
        "state": row[f"{name}_state"].lower(),
        "valid": row[f"{name}_pd_valid"],
        "data": row["safe_inputs" if name == "master" else "safe_outputs"],
    }


def _outputs_in_fail_safe(row: dict) -> bool:
    """Implementation B puts its real outputs into FailSafeData; we send zeros (§9, §16).

    From the first such frame on the chains differ, and both are right.
    """
    sent = row["master_tx"]
    return sent is not None and sent.startswith("08") and set(sent[2:4]) != {"0"}


def _rows(run: str) -> tuple[dict, list[dict]]:
    lines = [json.loads(x) for x in need("traces", run).read_text("utf-8").splitlines()]
    return lines[0], lines[1:]


@pytest.mark.parametrize("side", ["master", "slave"])
@pytest.mark.parametrize("run", RUNS)
def test_recorded_run_is_reproduced(run: str, side: str):
    config, rows = _rows(run)
    if any(r.get(f"{side}_state") is None for r in rows if r["type"] == "step"):
        pytest.skip("this side is a script in the recording")
    ours = _Side(side, config)
    for row in rows:
        if side == "master" and _outputs_in_fail_safe(row):
            assert row["n"] > 5  # the whole start-up has been compared
            break
        for text in row["commands"]:
            who, _, what = text.partition(".")
            if who == side:
                ours.command(what)
        got = ours.step(row)
        want = _expected(row, side)
        assert {k: got[k] for k in want} == want, f"step {row['n']}: {row.get('note', '')}"
        if row[f"{side}_event"] == f"by_{side}" or row[f"{side}_event"].startswith("by_"):
            assert row[f"{side}_reason"] in got["codes"], f"step {row['n']}"


@pytest.mark.parametrize("run", RUNS)
def test_both_sides_together_reproduce_the_run(run: str):
    config, rows = _rows(run)
    steps = [r for r in rows if r["type"] == "step"]
    if any(r[f"{s}_state"] is None for r in steps for s in ("master", "slave")):
        pytest.skip("one side is a script in the recording")
    sides = {name: _Side(name, config) for name in ("master", "slave")}
    for row in rows:
        if _outputs_in_fail_safe(row):
            break
        for text in row["commands"]:
            who, _, what = text.partition(".")
            sides[who].command(what)
        for name, ours in sides.items():
            got = ours.step(row)
            assert got["tx"] == row[f"{name}_tx"], f"step {row['n']} {name}"
    assert State.DATA in {s.end.state for s in sides.values()} or "address" in run
