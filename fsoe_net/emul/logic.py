"""Logic of an emulated safety master: outputs on only after a reset edge, all inputs good."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["SafetyLogic"]


@dataclass(slots=True)
class SafetyLogic:
    """Decides whether the outputs of a net are on.

    A reset counts only as a rising edge while every input is good: one that is held, or pressed
    before the inputs are good, does not (ISO 13849-1 asks for a deliberate action).
    """

    on: bool = False
    pressed: bool = False
    _was_pressed: bool = False

    def update(self, inputs_good: bool) -> bool:
        """Return whether the outputs are on from now on.

        Args:
            inputs_good: All safe inputs are 1, valid, and all connections exchange data.
        """
        edge = self.pressed and not self._was_pressed
        self._was_pressed = self.pressed
        if not inputs_good:
            self.on = False
        elif edge:
            self.on = True
        return self.on
