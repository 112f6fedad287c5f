"""Logic of an emulated safety master: outputs on only after a reset edge, all inputs good."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(slots=True)
class SafetyLogic:
    """Decides whether the outputs of a net are on.

    A reset counts only as a rising edge while every input is good: one that is held, or pressed
    before the inputs are good, does not (ISO 13849-1 asks for a deliberate action).

    ``delays_ns`` are outputs that stay on for a time after the others have gone off, whatever the
    inputs do meanwhile: the STO of a drive that is stopped by SS1 first.
    """

    on: bool = False
    delays_ns: Mapping[str, int] = field(default_factory=dict)
    pressed: bool = False
    _was_pressed: bool = False
    _now_ns: int = 0
    _off_since_ns: int | None = None

    def update(self, inputs_good: bool, now_ns: int = 0) -> bool:
        """Return whether the outputs are on from now on.

        Args:
            inputs_good: All safe inputs are 1, valid, and all connections exchange data.
            now_ns: This moment.
        """
        self._now_ns, was_on = now_ns, self.on
        edge = self.pressed and not self._was_pressed
        self._was_pressed = self.pressed
        if not inputs_good:
            self.on = False
        elif edge:
            self.on = True
        if was_on and not self.on:
            self._off_since_ns = now_ns
        return self.on

    def is_on(self, output: str) -> bool:
        """Return whether an output is on: all are, or its delay has not passed."""
        if self.on or self._off_since_ns is None:
            return self.on
        return self._now_ns - self._off_since_ns < self.delays_ns.get(output, 0)

    def power_cycle(self) -> None:
        """Switch off and on: all outputs are off."""
        self.on, self._off_since_ns = False, None
