"""One difference, as data."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Change", "Fact"]

Fact = int | str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One difference.

    Attributes:
        kind: ``added``, ``removed``, ``exchanged``, ``moved`` or ``changed``.
        area: ``network``, ``subdevice``, ``sync_manager``, ``frame``, ``entries``, ``sdo``,
            ``copy``, ``connection`` or ``safety_function``.
        where: SubDevice, sync manager, copy or connection, as A calls it.
        what: The fact that changed; empty for something that came or went as a whole.
        before: In A.
        after: In B.
        entries: Addresses of the entries that changed together.
    """

    kind: str
    area: str
    where: str
    what: str = ""
    before: Fact = None
    after: Fact = None
    entries: tuple[str, ...] = ()
