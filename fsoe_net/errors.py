"""Exceptions of fsoe-net.

Errors in a user's file are data (`fsoe_net.Diagnostic`), not exceptions. Exceptions are for the
outside world and for programming mistakes:

    FsnError                      anything this package raises on purpose
    +-- EnvironmentFault          a tool, permission or compiled part is missing      (exit 3)
    |   +-- CoreMissing           the compiled module could not be loaded
    |   +-- ControlRefused        fsn-master refused a request; carries the name of its status
    InputError                a file was rejected as a whole; carries diagnostics (exit 1)
    |   +-- FilePresent           a file exists and was not to be replaced
    |   +-- PlanFormatError       bytes that are not a valid .fsnplan
    |   +-- RecordingError        an invalid line in a recorded run
    |   +-- IncidentError         an invalid line in an incident file
    +-- FsoeError                 misuse of the FSoE engine
    |   +-- PduSizeError          invalid size of an FSoE PDU
    |   +-- ConfigError           an FSoE instance was configured with impossible values
    +-- ConsoleError              a command of the console failed                     (exit 1)
    +-- CoreError                 the C core refused a call; carries its status
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from fsoe_net.diag.diagnostic import Diagnostic


class FsnError(Exception):
    """Base of all exceptions that this package raises deliberately."""

    exit_code = 3


class EnvironmentFault(FsnError):
    """The machine lacks something: a tool, a permission, the compiled part."""


class CoreMissing(EnvironmentFault):
    """The compiled module `fsoe_net.core._core` could not be loaded.

    Scenarios: a source tree that was never built; a wheel of another platform.
    """


class ControlRefused(EnvironmentFault):
    """A running ``fsn-master`` refused a request on its control socket.

    Args:
        message: The refused request, the reason, and the next step.
        status: Name of its ``fsn_status``, e.g. ``FSN_E_STATE``.
    """

    def __init__(self, message: str, status: str) -> None:
        super().__init__(message)
        self.status = status

    @property
    def bus_stopped(self) -> bool:
        """Whether the only reason is that the bus is not running."""
        return self.status == "FSN_E_STATE"

    @property
    def busy(self) -> bool:
        """Whether the same request may succeed a moment later."""
        return self.status == "FSN_E_BUSY"


class InputError(FsnError):
    """A file was rejected as a whole.

    Args:
        message: One sentence for the user; the text of the exception adds the first finding.
        diagnostics: Findings with locations; may be empty if the message is complete. A traceback
            shows the next step of the first one as a note.
    """

    exit_code = 1

    def __init__(self, message: str, diagnostics: Sequence[Diagnostic] = ()) -> None:
        super().__init__(message)
        self.message = message
        self.diagnostics = tuple(diagnostics)
        for first in self.diagnostics[:1]:
            if first.hint:
                self.add_note(first.next_step)

    def __str__(self) -> str:
        """Return the message and the first finding, in one line."""
        return ": ".join([self.message, *(first.headline for first in self.diagnostics[:1])])


class FilePresent(InputError):
    """A file exists and is kept; each user interface adds how to replace it.

    Args:
        path: The file.
    """

    def __init__(self, path: object) -> None:
        super().__init__(f"nothing written: {path} exists; name another file, or replace it")
        self.add_note("overwrite=True replaces it")


class PlanFormatError(InputError):
    """Bytes that are not a valid `.fsnplan`: wrong magic, length, CRC, or inconsistent tables."""


class RecordingError(InputError):
    """A recorded run of FSoE ends has invalid content.

    Args:
        reason: The error, one sentence for the user.
        line: Line of the file, from 1; 0 for the whole file.
    """

    def __init__(self, reason: str, line: int = 0) -> None:
        super().__init__(f"line {line}: {reason}" if line else reason)
        self.reason = reason
        self.line = line


class IncidentError(InputError):
    """An invalid line in an incident file.

    Args:
        reason: The error, one sentence for the user.
        name: Name of the file.
        line: Line in it, from 1.
    """

    def __init__(self, reason: str, name: str, line: int) -> None:
        super().__init__(f"{name}:{line}: {reason}")
        self.reason = reason
        self.line = line


class FsoeError(FsnError):
    """Misuse of the FSoE engine."""


class PduSizeError(FsoeError, ValueError):
    """No FSoE PDU has this size (6 bytes, or 3 + 4 k bytes with k >= 1)."""


class ConfigError(FsoeError, ValueError):
    """An FSoE instance was configured with values the protocol does not allow."""


class CoreError(FsnError):
    """The C core rejected a call.

    Args:
        message: The rejected call, with the reason.
        status: Value of `fsn_status`, negative.
    """

    def __init__(self, message: str, status: int) -> None:
        super().__init__(message)
        self.status = status


class ConsoleError(FsnError):
    """A command of ``fsoe-net console`` failed, or an expectation was not met.

    Args:
        message: The error and the next step.
        is_usage: Usage error: nothing was sent to ``fsn-master``.
    """

    exit_code = 1

    def __init__(self, message: str, *, is_usage: bool = False) -> None:
        super().__init__(message)
        self.is_usage = is_usage
