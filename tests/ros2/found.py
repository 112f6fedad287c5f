"""What a bridge has published."""

from __future__ import annotations

from typing import Any


class Found:
    """What a participant sees of others."""

    def __init__(self, participant: Any) -> None:
        from cyclonedds.builtin import (
            BuiltinDataReader,
            BuiltinTopicDcpsPublication,
            BuiltinTopicDcpsSubscription,
        )

        self._participant = participant  # what is in it goes with it
        self._writers = BuiltinDataReader(participant, BuiltinTopicDcpsPublication)
        self._readers = BuiltinDataReader(participant, BuiltinTopicDcpsSubscription)

    def offers(self) -> set[str]:
        return {row.topic_name for row in self._writers.read(100)}

    def requests(self) -> set[str]:
        """Topics somebody else subscribes to."""
        names = {row.topic_name for row in self._readers.read(100)}
        return {name for name in names if not name.startswith("DCPS")}
