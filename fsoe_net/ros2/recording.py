"""Records published messages as an MCAP file, for Foxglove, PlotJuggler and ``ros2 bag``."""

from __future__ import annotations

import dataclasses
from typing import Annotated, get_args, get_origin, get_type_hints

from cyclonedds.idl import IdlStruct, types
from mcap.writer import CompressionType, Writer

from fsoe_net.errors import EnvironmentFault
from fsoe_net.ros2.messages import HASHES

_CHUNK = 1 << 16  # maximum loss if this process is killed, bytes


class McapFile:
    """An MCAP file that is being written; must be closed.

    Args:
        path: Path of the file, which is replaced.

    Raises:
        EnvironmentFault: The file cannot be written.
    """

    def __init__(self, path: str) -> None:
        self.path, self.messages = path, 0
        self._fault = ""
        try:
            self._file = open(path, "wb")  # noqa: SIM115 - closed by close()
        except OSError as exc:
            raise EnvironmentFault(f"cannot write {path}: {exc.strerror}") from exc
        self._writer = Writer(self._file, chunk_size=_CHUNK, compression=CompressionType.ZSTD)
        self._writer.start(profile="ros2")
        self._schemas: dict[type[IdlStruct], int] = {}
        self._channels: dict[str, int] = {}

    def add(self, topic: str, message: IdlStruct, payload: bytes, time_ns: int) -> None:
        """Add a published message.

        Args:
            topic: Topic with its slash.
            message: Message that determines the type.
            payload: Its bytes with the encapsulation, as sent.
            time_ns: Time since 1970, UTC.

        A full disk ends the recording, which `check` reports.
        """
        if self._fault:
            return
        try:
            self._writer.add_message(
                self._channel(topic, type(message)), time_ns, payload, time_ns, self.messages
            )
        except OSError as exc:
            self._fault = exc.strerror or str(exc)
            return
        self.messages += 1

    def check(self) -> None:
        """Raise the error that ended the recording.

        Raises:
            EnvironmentFault: Disk full.
        """
        if self._fault:
            raise EnvironmentFault(f"the recording {self.path} has ended: {self._fault}")

    def _channel(self, topic: str, message: type[IdlStruct]) -> int:
        if topic not in self._channels:
            if message not in self._schemas:
                text = definition(message).encode()
                self._schemas[message] = self._writer.register_schema(
                    ros_name(message), "ros2msg", text
                )
            self._channels[topic] = self._writer.register_channel(
                topic,
                "cdr",
                self._schemas[message],
                # RIHS01 is the hash of a type by REP 2016.
                {"offered_qos_profiles": "", "topic_type_hash": f"RIHS01_{HASHES[message]}"},
            )
        return self._channels[topic]

    def close(self) -> None:
        """Write the index and close the file.

        Raises:
            EnvironmentFault: Disk full.
        """
        try:
            with self._file:
                self._writer.finish()
        except OSError as exc:
            raise EnvironmentFault(f"{self.path}: {exc.strerror}") from exc


def ros_name(message: type[IdlStruct]) -> str:
    """Return the name of a type in ROS: ``std_msgs/msg/Bool``."""
    name = str(message.__idl_typename__)
    return name.replace("::dds_", "").replace("::", "/").removesuffix("_")


def definition(message: type[IdlStruct]) -> str:
    """Return the definition of a message including nested ones, as in a recording."""
    parts: dict[str, str] = {}
    _define(message, parts)
    first, *others = parts
    short = {name: name.replace("/msg/", "/") for name in others}
    return parts[first] + "".join(f"{'=' * 80}\nMSG: {short[n]}\n{parts[n]}" for n in others)


def _define(message: type[IdlStruct], parts: dict[str, str]) -> None:
    name = ros_name(message)
    parts[name] = ""
    hints = get_type_hints(message, include_extras=True)
    lines = []
    for each in dataclasses.fields(message):
        kind, inner = _field(hints[each.name])
        if inner is not None:
            _define(inner, parts)
        lines.append(f"{kind} {each.name}\n")
    parts[name] = "".join(lines)


def _field(hint: object) -> tuple[str, type[IdlStruct] | None]:
    """Return the word of a type in a definition, and the message type in it, if any."""
    if get_origin(hint) is Annotated:
        said = get_args(hint)[1]
        if isinstance(said, types.sequence):
            word, inner = _field(said.subtype)
            return f"{word}[]", inner
        return str(said), None
    if isinstance(hint, type) and issubclass(hint, IdlStruct):
        return ros_name(hint).replace("/msg/", "/"), hint
    return {str: "string", bool: "bool"}[hint], None  # type: ignore[index]
