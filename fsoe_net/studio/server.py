"""The server of the page: one file, for one person at this machine or with the password."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path

import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response, StreamingResponse
from starlette.routing import Mount, Route
from starlette.staticfiles import StaticFiles

from fsoe_net.diag.printable import printable
from fsoe_net.errors import FsnError, InputError
from fsoe_net.live.result import ConnectionResult
from fsoe_net.plan.compile import compile_plan
from fsoe_net.plan.model import Plan
from fsoe_net.project.check import Checked, whole_network
from fsoe_net.project.simulate import prepare
from fsoe_net.simulate.session import run_virtual
from fsoe_net.studio.connections import LimitedProtocol
from fsoe_net.studio.document import content_of, state_of
from fsoe_net.studio.files import UPLOADS, file_routes
from fsoe_net.studio.folder import Folder
from fsoe_net.studio.guard import Guard
from fsoe_net.studio.listening import Listening, bound_socket
from fsoe_net.studio.live import Live
from fsoe_net.studio.records import Records
from fsoe_net.studio.test_records import TestRecords
from fsoe_net.studio.uploads import MAX_UPLOAD_BYTES, Uploads
from fsoe_net.studio.workspace import MAX_TEXT_BYTES, StaleVersion, Workspace

_TRIAL_NS = 1_000_000_000
"""Simulated time of a trial at most."""

_MOST_EVENTS = 500

Row = dict[str, object]


def try_network(checked: Checked) -> Row:
    """Run a network until nothing more happens, at most 1 s; nothing is sent to a bus.

    Args:
        checked: The network, with everything found in it.

    Returns:
        Plain JSON values: connections with their final state, and the events in order.

    Raises:
        InputError: The network has errors, or copies nothing.
        CoreMissing: The compiled part is missing.
    """
    resolution = whole_network(checked, "not tried")
    session = prepare(resolution, None, None, virtual=True)
    run = run_virtual(session, _TRIAL_NS, until_settled=True)
    absent = _absent(compile_plan(resolution))
    return {
        "passed": run.passed,
        "duration_ms": run.duration_ms,
        "connections": [_connection(row, absent) for row in run.connections],
        "events": [
            {"time_ms": event.time_ms, "source": event.source, "text": event.text}
            for event in run.events[:_MOST_EVENTS]
        ],
        "events_left_out": max(0, len(run.events) - _MOST_EVENTS),
    }


def _absent(plan: Plan) -> dict[str, str]:
    """Return the group of each SubDevice that an emulation leaves out."""
    return {
        sub.name: group.name
        for group in plan.groups
        if not plan.is_first_choice(group)
        for sub in plan.subdevices[group.first_subdevice :][: group.subdevice_count]
    }


def _connection(row: ConnectionResult, absent: dict[str, str]) -> Row:
    group = absent.get(row.main) or absent.get(row.sub)
    return {
        "name": row.name,
        "state": f"absent: {group}" if group else row.state.text,
        "absent": bool(group),
        "in_data": row.state.in_data,
        "time_to_data_ms": row.time_to_data_ms,
        "resets": row.resets,
        "last_reset": row.last_reset_text,
        "chosen": list(row.chosen),
    }


_ASSETS = Path(__file__).parent / "assets"
_BODY_LIMIT = 2 * MAX_TEXT_BYTES + 4096  # JSON encodes some characters as two
_LOOK_EVERY_S = 0.5
_EVENTS_S = 1.0  # of silence; after that a stream sends a keep-alive and checks for the end

Body = dict[str, object]
Act = Callable[[Workspace, int, Body], Sequence[str] | None]


def _text(body: Body) -> str:
    text = body.get("text")
    if not isinstance(text, str):
        raise InputError("text is missing")
    return text


def _finding(body: Body) -> int:
    number = body.get("finding")
    if type(number) is not int:
        raise InputError("finding is a number")
    return number


_ACTS: dict[str, Act] = {
    "text": lambda workspace, version, body: workspace.replace(version, _text(body)),
    "change": lambda workspace, version, body: workspace.change(version, body),
    "fix": lambda workspace, version, body: workspace.fix(version, _finding(body)),
    "undo": lambda workspace, version, _: workspace.undo(version),
    "redo": lambda workspace, version, _: workspace.redo(version),
    "save": lambda workspace, version, _: workspace.save(version),
    "look": lambda *_: None,
    "take": lambda workspace, version, _: workspace.take_file(version),
}


class Studio:
    """A server for one file; it listens as soon as it is created.

    Args:
        workspace: The file.
        port: Port to listen on; 0 for any free one.
        control_socket: Control socket of a running ``fsn-master`` that the live page follows.
        remote: Settings for access from other machines; without it, only 127.0.0.1.
        allow_control: Whether the live page may control the bus of that ``fsn-master``.
        runs_emulated: Whether an emulated run starts with the server.

    Attributes:
        url: Opens the page; once on this machine, with the password on others.

    Raises:
        EnvironmentFault: The address or port cannot be used.
    """

    def __init__(
        self,
        workspace: Workspace,
        *,
        port: int = 0,
        control_socket: str | None = None,
        remote: Listening | None = None,
        allow_control: bool = False,
        runs_emulated: bool = False,
    ) -> None:
        self._workspace = workspace
        self._uploads = Uploads()
        self._acts: dict[str, Act] = {
            **_ACTS,
            "add": self._uploads.add,
            "example": self._uploads.example,
            "import": self._uploads.take,
        }
        self._socket = bound_socket("127.0.0.1" if remote is None else remote.address, port)
        port = self._socket.getsockname()[1]
        self._live = Live(
            workspace,
            control_socket,
            lambda: self._server.should_exit,
            lambda: None if self._uploads.scan is None else self._uploads.scan[1],
            allow_control=allow_control,
            runs_emulated=runs_emulated,
        )
        folder = Folder(workspace.path)
        app = Starlette(
            routes=[
                Route("/", self._page),
                Route("/api/state", self._state),
                Route("/api/events", self._events),
                Route("/api/try", self._try, methods=["POST"]),
                *file_routes(workspace, self._uploads),
                *self._live.routes,
                *Records(workspace, folder).routes,
                *TestRecords(workspace, folder).routes,
                Route("/api/{act}", self._act, methods=["POST"]),
                Mount("/assets", StaticFiles(directory=_ASSETS)),
            ],
            lifespan=self._watching,
        )
        limits = {UPLOADS: MAX_UPLOAD_BYTES}
        login = None if remote is None else (remote.names, remote.password)
        guard = Guard(app, port=port, body_limit=_BODY_LIMIT, limits=limits, remote=login)
        self.url = guard.url
        self._changed, self._trying = asyncio.Event(), asyncio.Lock()
        config = uvicorn.Config(
            guard,
            loop="asyncio",  # accepts connections through the socket, see LimitedSocket
            http=LimitedProtocol,
            ssl_certfile=None if remote is None else remote.certificate,
            ssl_keyfile=None if remote is None else remote.key,
            proxy_headers=False,  # a trusted proxy is not supported
            log_level="critical",
            access_log=False,
            server_header=False,
            timeout_graceful_shutdown=3,
            lifespan="on",
            ws="none",
        )
        self._server = uvicorn.Server(config)

    def run(self) -> None:
        """Serve until `stop`, SIGINT or SIGTERM."""
        self._server.run(sockets=[self._socket])

    def stop(self) -> None:
        """End `run`; may be called from any thread."""
        self._server.should_exit = True

    async def _page(self, _: Request) -> Response:
        return FileResponse(_ASSETS / "index.html")

    async def _state(self, _: Request) -> Response:
        return await self._answer()

    async def _act(self, request: Request) -> Response:
        act = self._acts.get(request.path_params["act"])
        if act is None:
            return JSONResponse({"error": "unknown request"}, 404)
        try:
            body = await request.json()
        except (ValueError, UnicodeDecodeError, RecursionError):
            return JSONResponse({"error": "the request is not valid JSON"}, 400)
        version = body.get("version") if isinstance(body, dict) else None
        # `bool` is an `int` in Python; only an actual number is a version.
        if type(version) is not int:
            return JSONResponse({"error": "the request names no version"}, 400)
        try:
            # In a thread: a change checks the whole network and must not block other pages.
            said = await run_in_threadpool(act, self._workspace, version, body)
        except StaleVersion:
            text = "something else has changed meanwhile; look at it, and do it again"
            return await self._answer(error=text, status=409)
        except (FsnError, ValueError) as exc:
            return await self._answer(error=printable(str(exc)), status=422)
        # Only after a change, because other pages read the new state when notified.
        self._announce()
        return await self._answer(said=said or ())

    async def _try(self, _: Request) -> Response:
        checked = self._workspace.checked
        try:
            async with self._trying:  # one at a time
                tried = await run_in_threadpool(try_network, checked)
        except FsnError as exc:
            return JSONResponse({"error": str(exc)}, 422)
        return JSONResponse({"error": "", "content": content_of(checked), **tried})

    async def _answer(
        self, *, error: str = "", said: Sequence[str] = (), status: int = 200
    ) -> Response:
        state = await run_in_threadpool(state_of, self._workspace, self._uploads.scan)
        own = {"error": error, "said": list(said), "may_control": self._live.may_control}
        return JSONResponse(own | state, status)

    async def _events(self, _: Request) -> Response:
        """Send each new version, so that a second tab is updated."""

        async def versions() -> AsyncIterator[str]:
            sent = 0
            while not self._server.should_exit:
                changed = self._changed
                if sent != self._workspace.version:
                    sent = self._workspace.version
                    yield f"data: {json.dumps(sent)}\n\n"
                try:
                    async with asyncio.timeout(_EVENTS_S):
                        await changed.wait()
                except TimeoutError:
                    yield ": still there\n\n"

        return StreamingResponse(versions(), media_type="text/event-stream")

    def _announce(self) -> None:
        # Another event for the next change: a lock would stay locked if a page disconnects.
        self._changed.set()
        self._changed = asyncio.Event()

    @contextlib.asynccontextmanager
    async def _watching(self, _: Starlette) -> AsyncIterator[None]:
        task = asyncio.create_task(self._watch())
        self._live.open()
        try:
            yield
        finally:
            task.cancel()
            await run_in_threadpool(self._live.close)
            self._uploads.clear()

    async def _watch(self) -> None:
        while True:
            await asyncio.sleep(_LOOK_EVERY_S)
            if await run_in_threadpool(self._workspace.look):
                self._announce()
