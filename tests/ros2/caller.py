"""A client of a service."""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import pytest
from patience import PATIENCE_S

from fsoe_net.ros2.messages import HASHES, TriggerRequest, TriggerResponse


class Caller:
    """Calls a service as `rmw_cyclonedds_cpp` does: a mark, and a header before each request."""

    def __init__(
        self,
        domain: int,
        service: str,
        request: Any = TriggerRequest,
        reply: Any = TriggerResponse,
    ) -> None:
        from cyclonedds.core import Policy, Qos
        from cyclonedds.domain import DomainParticipant
        from cyclonedds.pub import DataWriter
        from cyclonedds.sub import DataReader
        from cyclonedds.topic import Topic
        from cyclonedds.util import duration

        def qos(message: Any) -> Any:
            return Qos(
                Policy.Reliability.Reliable(duration(infinite=True)),
                Policy.Durability.Volatile,
                Policy.History.KeepLast(10),
                Policy.Userdata(f"clientid=1.2.3;typehash=RIHS01_{HASHES[message]};".encode()),
            )

        me = DomainParticipant(domain)
        self._writer = DataWriter(me, Topic(me, f"rq{service}Request", request), qos=qos(request))
        self._reader = DataReader(me, Topic(me, f"rr{service}Reply", reply), qos=qos(reply))
        self._request = request
        self._number = 0

    def marks(self) -> tuple[set[bytes], set[bytes]]:
        """Return the user data of the service's reader and of its writer, once both are there."""
        from cyclonedds.core import Policy

        from fsoe_net.ros2.node import read_endpoints

        def marks_of(handles: Any, row: Any) -> set[bytes]:
            rows = (read_endpoints(partial(row, handle)) for handle in handles())
            return {bytes(r.qos[Policy.Userdata].data) for r in rows if r is not None}

        reader, writer = self._reader, self._writer
        while True:
            first = marks_of(writer.get_matched_subscriptions, writer.get_matched_subscription_data)
            second = marks_of(reader.get_matched_publications, reader.get_matched_publication_data)
            if first and second:
                return first, second

    def call(self, *fields: Any) -> Any:
        """Send a request; return the reply."""
        self.marks()  # as `wait_for_service`
        self._number += 1
        self._writer.write(self._request(0x1122334455667788, self._number, *fields))
        until = time.monotonic() + PATIENCE_S
        while time.monotonic() < until:
            for reply in self._reader.take(10):
                if reply.sample_info.valid_data and reply.number == self._number:
                    assert reply.client == 0x1122334455667788
                    return reply
        pytest.fail("no reply")
