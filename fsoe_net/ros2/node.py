"""A node of ROS 2 on DDS: topics and services with the names, types and QoS of an rmw.

Needs ``cyclonedds``. Does not publish ``ros_discovery_info``, because its message differs between
Humble and later distributions. Therefore `ros2 topic` finds everything, but `ros2 node` does not.

Services answer only callers on ``rmw_cyclonedds_cpp``, which puts the identity of a request in
front of its payload. ``rmw_fastrtps_cpp`` puts it in inline QoS (PID_RELATED_SAMPLE_IDENTITY),
which Cyclone DDS can neither write nor read. An endpoint cannot reject a caller, but it can be
absent: a service has endpoints only while a caller that can be answered waits for it.
"""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import Any, TypeVar
from uuid import UUID

from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopicDcpsPublication,
    BuiltinTopicDcpsSubscription,
)
from cyclonedds.core import DDSException, InstanceState, Listener, Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from fsoe_net.errors import EnvironmentFault
from fsoe_net.ros2.messages import HASHES, Header, Stamp
from fsoe_net.ros2.recording import McapFile

HERE = """<CycloneDDS><Domain Id="any">
<General><Interfaces><NetworkInterface name="lo" multicast="true"/></Interfaces></General>
<Discovery><ParticipantIndex>auto</ParticipantIndex>
<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers></Discovery></Domain></CycloneDDS>"""
_DEPTH = 10  # of rmw_qos_profile_default and rmw_qos_profile_services_default
_FOUND_S = 1.0
_MOST_CHANGES = 10_000  # endpoints that appeared or disappeared, handled at a time
_OURS = "fsoe_net"  # name of each writer
_MOST_REQUESTS = 32  # of slow services that wait; further ones get no reply
_MOST_UNREADABLE = 1000  # in a row; then other readers are served
_WAIT = duration(milliseconds=100)
_CALLER = b"clientid="  # in the user data of endpoints of a client of `rmw_cyclonedds_cpp`
# `cyclonedds` converts the QoS of an endpoint in buffers shared by all threads of a process.
_conversion = threading.Lock()

_T = TypeVar("_T")
Received = Callable[[Any, str], None]
"""Receives a message, and a text that identifies the process that sent it."""


def header() -> Header:
    """Return a header with the current time."""
    seconds, nanoseconds = divmod(time.time_ns(), 1_000_000_000)
    return Header(stamp=Stamp(sec=seconds, nanosec=nanoseconds))


class _Arrived(Listener):
    """Puts a reader into a queue when it has data."""

    def __init__(self, arrivals: queue.SimpleQueue[DataReader | None]) -> None:
        super().__init__()
        self._arrivals = arrivals

    def on_data_available(self, reader: DataReader | None) -> None:
        if reader is not None:  # None until its constructor has returned
            self._arrivals.put(reader)


@dataclass(slots=True)
class _Service:
    """A service. ``reader`` keeps its endpoints: `cyclonedds` deletes them when it is dropped."""

    name: str
    types: tuple[type[IdlStruct], type[IdlStruct]]
    answer: Callable[[Any, str], tuple[Any, ...]]
    mark: str
    is_slow: bool = False
    reader: DataReader | None = None
    callers: dict[UUID, bool] = field(default_factory=dict)
    """Whether each reader of its replies can be answered."""


class Node:
    """Publishers, subscriptions and services of one participant; must be closed.

    Messages are handled by a separate thread, one after another; requests of slow services by a
    second one.

    Args:
        domain: Domain ID, 0 to 232.
        here_only: Use only the loopback, so that no other machine can receive or send.
        recording: Receives all published messages.

    Raises:
        EnvironmentFault: The network is missing, or no port of the domain is free.
    """

    maker = "Cyclone DDS"
    answers = "RMW_IMPLEMENTATION=rmw_cyclonedds_cpp"
    """The callers that a service can answer."""
    missing: Mapping[str, str] = MappingProxyType({})  # it has its types itself

    def __init__(self, domain: int, *, here_only: bool, recording: McapFile | None = None) -> None:
        self.unsent = self.unreadable = self.unanswered = 0
        self._recording = recording
        self._lock = threading.Lock()
        try:
            self._domain = Domain(domain, HERE) if here_only else None
            self._participant = DomainParticipant(domain)
        except DDSException as exc:
            raise EnvironmentFault(
                f"DDS does not start in domain {domain}: {exc.msg.strip()}; is a network there, "
                "and what does CYCLONEDDS_URI say?"
            ) from exc
        self._offers = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)
        self._others: dict[UUID, str] = {}  # topic of each foreign publisher
        self._awaits = BuiltinDataReader(self._participant, BuiltinTopicDcpsSubscription)
        self._services: dict[str, _Service] = {}  # by the topic of its replies
        self._writers: dict[str, DataWriter] = {}
        self._readers: dict[object, Received] = {}
        self._arrivals: queue.SimpleQueue[DataReader | None] = queue.SimpleQueue()
        self._listener = _Arrived(self._arrivals)
        self._thread = threading.Thread(target=self._serve, name="dds", daemon=True)
        self._thread.start()
        self._requests: queue.Queue[Callable[[], None] | None] = queue.Queue(_MOST_REQUESTS)
        self._slow = threading.Thread(target=self._serve_slow, name="dds slow", daemon=True)
        self._slow.start()

    def close(self) -> None:
        """Leave the domain."""
        self._arrivals.put(None)
        self._thread.join()
        self._requests.put(None)
        self._slow.join()
        self._readers.clear()
        self._services.clear()
        self._writers.clear()
        # `cyclonedds` deletes an entity when no object refers to it.
        del self._offers, self._awaits, self._participant, self._domain

    def publish(self, topic: str, message: IdlStruct) -> None:
        """Publish a message; a subscriber that has stopped reading misses it.

        Args:
            topic: Topic in ROS notation, with its slash.
            message: Message with a type in `HASHES`; always the same type for a topic.
        """
        with self._lock:
            writer = self._writers.get(topic)
            if writer is None:
                writer = self._writer(f"rt{topic}", type(message), _qos(type(message)))
                self._writers[topic] = writer
            _write(self, writer, message)
            if self._recording is not None:
                payload = message.serialize(use_version_2=False)
                self._recording.add(topic, message, payload, time.time_ns())

    def has_other_publisher(self, topic: str) -> bool:
        """Return whether a program other than fsoe-net currently publishes a topic."""
        for row in self._changes(self._offers):
            if _is_alive(row) and Policy.EntityName(_OURS) not in row.qos:
                self._others[row.key] = row.topic_name
            else:
                self._others.pop(row.key, None)
        return f"rt{topic}" in self._others.values()

    def subscribe(self, topic: str, message: type[IdlStruct], received: Received) -> object:
        """Handle messages as they arrive; of a fast sender, only the newest one."""
        return self._receive(f"rt{topic}", message, _qos(message, depth=1), received)

    def unsubscribe(self, reader: object) -> None:
        """Unsubscribe."""
        self._readers.pop(reader, None)

    def serve(
        self,
        name: str,
        types: tuple[type[IdlStruct], type[IdlStruct]],
        answer: Callable[[Any, str], tuple[Any, ...]],
        *,
        is_slow: bool = False,
    ) -> None:
        """Serve requests of callers whose rmw is Cyclone DDS, once `offer_services` finds them.

        Args:
            name: Name of the service, with its slash.
            types: Types of a request and of its reply, in `HASHES`.
            answer: Executes the request of a process and returns the fields of the reply.
            is_slow: Whether it may take seconds; other messages are handled meanwhile.
        """
        # A caller waits until a reader and a writer have the same mark: the server and a number.
        number = len(self._services).to_bytes(4, "big")
        mark = ".".join(f"{b:x}" for b in self._participant.guid.bytes[:12] + number)
        service = _Service(name, types, answer, f"serviceid={mark};", is_slow)
        self._services[f"rr{name}Reply"] = service

    def offer_services(self) -> tuple[str, ...]:
        """Offer exactly the services that have a caller which can be answered.

        Returns:
            Names of the services that have other callers.
        """
        for row in self._changes(self._awaits):
            if not _is_alive(row):
                for service in self._services.values():
                    service.callers.pop(row.key, None)
            elif row.topic_name in self._services:
                self._services[row.topic_name].callers[row.key] = _is_answerable(row)
        for service in self._services.values():
            if not any(service.callers.values()):
                self.unsubscribe(service.reader)
                service.reader = None
            elif service.reader is None:
                service.reader = self._offer(service)
        waiting = (s.name for s in self._services.values() if not all(s.callers.values()))
        return tuple(waiting)

    def _offer(self, service: _Service) -> DataReader:
        asking, answering = service.types
        qos = _qos(answering, extra=service.mark)
        writer = self._writer(f"rr{service.name}Reply", answering, qos)

        def respond(request: Any, sender: str) -> None:
            # A caller that receives no reply would not know that its request was executed.
            if _is_reached(writer, sender):
                fields = service.answer(request, sender)
                _write(self, writer, answering(request.client, request.number, *fields))
            else:
                self.unanswered += 1

        def postpone(request: Any, sender: str) -> None:
            try:
                self._requests.put_nowait(partial(respond, request, sender))
            except queue.Full:
                self.unanswered += 1

        received = postpone if service.is_slow else respond
        qos = _qos(asking, extra=service.mark)
        return self._receive(f"rq{service.name}Request", asking, qos, received)

    def _changes(self, endpoints: BuiltinDataReader) -> Iterator[Any]:
        """Yield endpoints that appeared, changed or disappeared since the previous call."""
        # Only changes: each read of a row uses memory of `cyclonedds` that is never released. One
        # at a time: rows taken together with an undecodable one would be lost.
        for _ in range(_MOST_CHANGES):
            rows = read_endpoints(lambda: endpoints.take(1))
            if rows is None:
                self.unreadable += 1
                continue
            if not rows:
                return
            yield rows[0]

    def _writer(self, topic: str, message: type[IdlStruct], qos: Qos) -> DataWriter:
        named = qos + Qos(Policy.EntityName(_OURS))
        return DataWriter(self._participant, Topic(self._participant, topic, message), qos=named)

    def _receive(
        self, topic: str, message: type[IdlStruct], qos: Qos, received: Received
    ) -> DataReader:
        reader = DataReader(
            self._participant,
            Topic(self._participant, topic, message),
            qos=qos,
            listener=self._listener,
        )
        self._readers[reader] = received
        self._arrivals.put(reader)  # messages may have arrived before it was stored
        return reader

    def _serve(self) -> None:
        # No local variable of this loop may hold a reader: it would outlive its service.
        while self._handle(self._arrivals.get()):
            pass

    def _serve_slow(self) -> None:
        while (request := self._requests.get()) is not None:
            request()

    def _handle(self, reader: DataReader | None) -> bool:
        """Handle all messages of a reader; return whether more can arrive."""
        received = self._readers.get(reader)
        while received is not None and (message := self._next(reader)) is not None:
            if message.sample_info.valid_data:
                received(message, _sender(reader, message))
        return reader is not None

    def _next(self, reader: DataReader) -> Any:
        """Return the next readable message, or ``None``; unreadable ones are counted."""
        for _ in range(_MOST_UNREADABLE):
            try:
                return next(iter(reader.take(1)), None)
            except Exception:  # arbitrary bytes of the network can break its decoder
                self.unreadable += 1
        return None


def read_endpoints(read: Callable[[], _T]) -> _T | None:
    """Return data that a function reads about endpoints, or ``None`` if they cannot be decoded."""
    with _conversion:
        try:
            return read()
        except Exception:  # arbitrary bytes of the network can break the decoder of a QoS
            return None


def _sender(reader: DataReader, message: IdlStruct) -> str:
    """Return the sender: its participant, or its publisher if the participant has left."""
    handle = message.sample_info.publication_handle
    found = read_endpoints(lambda: reader.get_matched_publication_data(handle))
    return str(handle if found is None else found.participant_key)


def _is_alive(row: Any) -> bool:
    return bool(row.sample_info.instance_state == InstanceState.Alive)


def _is_answerable(row: Any) -> bool:
    """Return whether a reader of replies belongs to `rmw_cyclonedds_cpp`."""
    data = row.qos[Policy.Userdata]
    return data is not None and _CALLER in data.data


def _is_reached(writer: DataWriter, participant: str) -> bool:
    """Return whether the caller reads the reply; its writer may be found before its reader."""
    until = time.monotonic() + _FOUND_S
    while time.monotonic() < until:
        handles = writer.get_matched_subscriptions()
        rows = (read_endpoints(partial(writer.get_matched_subscription_data, h)) for h in handles)
        found = [r for r in rows if r is not None and str(r.participant_key) == participant]
        if found:
            return any(map(_is_answerable, found))
        time.sleep(0.005)
    return False


def _write(node: Node, writer: DataWriter, message: IdlStruct) -> None:
    try:
        writer.write(message)
    except DDSException:  # a subscriber that has stopped reading
        node.unsent += 1


def _qos(message: type[IdlStruct], *, depth: int = _DEPTH, extra: str = "") -> Qos:
    """Return the QoS of ``rmw_qos_profile_default``, with the hash of the type."""
    said = f"{extra}typehash=RIHS01_{HASHES[message]};"
    return Qos(
        Policy.Reliability.Reliable(_WAIT),
        Policy.Durability.Volatile,
        Policy.History.KeepLast(depth),
        Policy.WriterDataLifecycle(autodispose=False),
        # The encoding that ROS 2 uses, XCDR1.
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.Userdata(said.encode()),
    )
