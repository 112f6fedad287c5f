"""The files next to the network, by number: the page never names a path."""

from __future__ import annotations

from fsoe_net.errors import InputError
from fsoe_net.project.companion_files import CompanionFile, CompanionKind, files_beside


class Folder:
    """The folder of a network file.

    Args:
        network: The file.
    """

    def __init__(self, network: str) -> None:
        self._network = network
        self._numbers: dict[str, int] = {}

    def look(self) -> list[tuple[int, CompanionFile]]:
        """Return the current files; a file keeps its number as long as the server runs."""
        rows = files_beside(self._network)
        return [(self._numbers.setdefault(row.path, len(self._numbers)), row) for row in rows]

    def find(self, number: object, *kinds: CompanionKind) -> CompanionFile:
        """Return a file of these kinds by its number.

        Raises:
            InputError: It does not exist, or has another kind.
        """
        for here, row in self.look():
            if str(here) == str(number) and row.kind in kinds:
                return row
        raise InputError("this file no longer exists; look at the list again")
