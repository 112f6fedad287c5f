"""Fixtures of safety functions: a network to make a budget of, and the recorded budgets."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from changed import compare
from timing.made_budget import EXAMPLE, FUNCTION, Maker, budget_of, whole

from fsoe_net.formats.own.network import load_network
from fsoe_net.model.resolve import Resolution, resolve
from fsoe_net.timing.budget import Budget, make_budget


@pytest.fixture
def resolution_of(tmp_path: Path) -> Maker:
    def make(functions: str = FUNCTION, network: tuple[str, str] = ("", "")) -> Resolution:
        text = EXAMPLE.read_text().replace("devices/", f"{EXAMPLE.parent}/devices/")
        path = tmp_path / "network.yaml"
        path.write_text(text.replace(*network) + functions)
        loaded = load_network([path])
        assert loaded.network is not None
        assert [d for d in loaded.diagnostics if d.code == "FSN113"] == []
        return resolve(loaded.network)

    return make


@pytest.fixture
def budgets_recorded(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Iterator[None]:
    """Compare every budget of a test with the recorded ones, as a whole."""
    made = make_budget
    rows: list[str] = []

    def kept(*args: object, **more: object) -> Budget:
        budget = made(*args, **more)  # type: ignore[arg-type]
        told = [c for c in budget.connections if c.functions or c.measured is not None]
        for one in (*budget.functions, *told):
            rows.extend(whole(one))
        return budget

    monkeypatch.setitem(budget_of.__globals__, "make_budget", kept)
    yield
    if rows and not hasattr(request.function, "hypothesis"):
        name = f"{request.path.stem} {request.node.name}".replace(":", " ")
        compare(__file__, name, ((str(n), row) for n, row in enumerate(rows)))
