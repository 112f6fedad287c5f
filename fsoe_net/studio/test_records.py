"""The test record, filled in at the machine: display and entries of the page."""

from __future__ import annotations

import hashlib
import os
import threading
from collections.abc import Callable, Mapping

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from fsoe_net.acceptance.report import plan_to_show
from fsoe_net.diag.diagnostic import Diagnostic, Severity
from fsoe_net.diag.printable import printable
from fsoe_net.errors import FsnError, InputError
from fsoe_net.model.test_record import EMULATED_NOTE, StepResult, TestRecord, TestStep
from fsoe_net.project.check import whole_network
from fsoe_net.project.companion_files import CompanionKind
from fsoe_net.studio.folder import Folder
from fsoe_net.studio.workspace import Workspace
from fsoe_net.test_record.entries import (
    Conflict,
    MachineEntry,
    device_fields,
    enter,
    step_fields,
)
from fsoe_net.test_record.trial import Trial, read_test_record

_NEW = "test-record.yaml"
_MOST_NOTES = 5

Row = dict[str, object]


class TestRecords:
    """Routes of the test record.

    Args:
        workspace: The network file.
        folder: Folder of the network file and the test records.

    Attributes:
        routes: Routes to add to the server.
    """

    def __init__(self, workspace: Workspace, folder: Folder) -> None:
        self._workspace, self._folder = workspace, folder
        self._entering = threading.Lock()
        self.routes = [
            Route("/api/test-record", self._show),
            Route("/api/test-record/new", self._new, methods=["POST"]),
            Route("/api/test-record/enter", self._enter, methods=["POST"]),
        ]

    async def _show(self, request: Request) -> Response:
        return await _answered(self._state, request.query_params.get("file"))

    async def _new(self, request: Request) -> Response:
        return await _answered(self._write_new)

    async def _enter(self, request: Request) -> Response:
        try:
            body = await request.json()
        except (ValueError, UnicodeDecodeError, RecursionError):
            body = None
        if not isinstance(body, dict):
            return JSONResponse({"error": "the request is not valid JSON"}, 400)
        return await _answered(self._entered, body)

    def _state(self, number: str | None) -> Row:
        files = [
            (n, row) for n, row in self._folder.look() if row.kind is CompanionKind.TEST_RECORD
        ]
        state: Row = {
            "error": "",
            "files": [{"number": n, "name": printable(row.name)} for n, row in files],
            "number": None,
            "key": "",
            "note": EMULATED_NOTE,
            "notes": [],
            "steps": [],
            "devices": [],
        }
        if not files:
            return state
        # An unknown number may come from a page that was loaded before a file was removed.
        chosen = next((n for n, _ in files if str(n) == number), files[0][0])
        path = self._folder.find(chosen, CompanionKind.TEST_RECORD).path
        test_record, found = self._read(path)
        notes = [printable(f"{d.message}; {d.hint}") for d in found if d.level is Severity.ERROR]
        more = {"number": chosen, "notes": notes[:_MOST_NOTES], "key": _key(path, test_record)}
        return state | _test_record(test_record) | more

    def _read(self, path: str) -> tuple[TestRecord, list[Diagnostic]]:
        """Return a test record, compared with the network if that compiles to a plan."""
        checked = self._workspace.checked
        try:
            resolution = whole_network(checked, "not compared")
        except InputError:
            _, test_record, found = read_test_record(path)
        else:
            plan = plan_to_show(resolution, checked.diagnostics)
            _, test_record, found = read_test_record(path, resolution, plan)
        return test_record, found

    def _write_new(self) -> Row:
        if not self._workspace.is_saved:
            raise InputError("save the network first: a test record is of the saved file")
        path = self._workspace.path
        target = os.path.join(os.path.dirname(path), _NEW)
        Trial.of([path], self._workspace.loading).save(target)
        return self._state(None)

    def _entered(self, body: Mapping[str, object]) -> Row:
        path = self._folder.find(body.get("file"), CompanionKind.TEST_RECORD).path
        entry = MachineEntry(
            step=_text(body, "step"),
            subdevice=_text(body, "subdevice"),
            before=_fields(body, "before"),
            now=_fields(body, "now"),
        )
        # Two pages may submit at once: nothing may happen between the check and the write.
        with self._entering:
            if _key(path, read_test_record(path)[1]) != body.get("key"):
                raise InputError(
                    "the test record is one of another configuration now; this entry stays in your "
                    "browser: load the page again"
                )
            return {"error": "", "present": enter(path, entry)}


def _key(path: str, test_record: TestRecord) -> str:
    """Return the identity of a test record's network and configuration."""
    parts = (os.path.realpath(path), test_record.plan_sha256, test_record.fingerprint)
    return hashlib.sha256("\0".join(parts).encode("utf-8", "surrogateescape")).hexdigest()[:32]


async def _answered(act: Callable[..., Row], *given: object) -> Response:
    try:
        return JSONResponse(await run_in_threadpool(act, *given))
    except Conflict as exc:
        return JSONResponse({"error": str(exc), "present": exc.present}, 409)
    except FsnError as exc:
        return JSONResponse({"error": printable(str(exc))}, 422)


def _text(body: Mapping[str, object], key: str) -> str:
    value = body.get(key, "")
    if not isinstance(value, str):
        raise InputError(f"{key} is a text")
    return value


def _fields(body: Mapping[str, object], key: str) -> dict[str, str]:
    value = body.get(key)
    if not isinstance(value, dict) or not all(isinstance(v, str) for v in value.values()):
        raise InputError(f"{key} is a map of texts")
    return value


def _test_record(test_record: TestRecord) -> Row:
    return {
        "steps": [_step(step) for step in test_record.machine_steps],
        "devices": [
            {
                "name": device.subdevice,
                "title": printable(device.subdevice),
                "fields": device_fields(device),
            }
            for device in test_record.devices
        ],
    }


def _step(step: TestStep) -> Row:
    return {
        "name": step.id,
        "title": printable(step.id),
        "what": printable(step.what),
        "expected": printable(step.expected),
        "limit_ms": step.limit_ms,
        "limit_source": printable(step.limit_source),
        "emulated": _seen(step.emulated),
        "live": _seen(step.live),
        "fields": step_fields(step),
        "is_open": step.is_open,
        "is_failed": step.is_failed,
    }


def _seen(seen: StepResult | None) -> str:
    if seen is None:
        return ""
    measured = "" if seen.measured_ms is None else f"{seen.measured_ms:g} ms {seen.time_is}"
    parts = (seen.outcome.value, measured.strip(), seen.remark)
    return printable(", ".join(part for part in parts if part))
