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
        from cyclonedds.core import InstanceState

        from fsoe_net.ros2.node import read_endpoints

        self._read_endpoints = read_endpoints  # a bridge in this process reads too
        self._alive = InstanceState.Alive
        self._participant = participant  # what is in it goes with it
        self._writers = BuiltinDataReader(participant, BuiltinTopicDcpsPublication)
        self._readers = BuiltinDataReader(participant, BuiltinTopicDcpsSubscription)

    def offers(self) -> set[str]:
        return self._names(self._writers)

    def requests(self) -> set[str]:
        """Topics somebody else subscribes to."""
        return {name for name in self._names(self._readers) if not name.startswith("DCPS")}

    def _names(self, reader: Any) -> set[str]:
        rows = self._read_endpoints(lambda: reader.read(100)) or ()
        alive = (row for row in rows if row.sample_info.instance_state == self._alive)
        return {row.topic_name for row in alive}
