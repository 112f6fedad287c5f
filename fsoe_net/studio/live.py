"""Requests of the live page about a running bus, an emulated run or a recorded one."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from typing import TypeGuard

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.routing import Route

from fsoe_net.errors import FsnError, InputError
from fsoe_net.model.scan import Scan
from fsoe_net.project.check import whole_network
from fsoe_net.studio.document import content_of
from fsoe_net.studio.live_control import LiveControl
from fsoe_net.studio.live_emulated import MOST_HELD_MS, EmulatedFeed
from fsoe_net.studio.live_feed import LiveFeed, printed
from fsoe_net.studio.live_master import MasterFeed
from fsoe_net.studio.live_rows import Row, recorded_view
from fsoe_net.studio.workspace import Workspace

_POLL_S = 0.01
_SILENCE_S = 1.0  # after that a stream sends a keep-alive
_MOST_LINES = 100

Body = dict[str, object]


class Live:
    """The sources of the live page and their routes.

    Args:
        workspace: The network that can be run.
        socket: Control socket of a running ``fsn-master``, or ``None``.
        ended: Whether the server is stopping.
        scan: Returns the scan that shows the cables of the network.
        allow_control: Whether a page may also control the bus of that ``fsn-master``.
        runs_emulated: Whether an emulated run starts with the server.
    """

    def __init__(
        self,
        workspace: Workspace,
        socket: str | None,
        ended: Callable[[], bool],
        scan: Callable[[], Scan | None],
        *,
        allow_control: bool = False,
        runs_emulated: bool = False,
    ) -> None:
        self._workspace, self._runs_emulated = workspace, runs_emulated
        self._ended, self._scan = ended, scan
        self._starting, self._controlling = asyncio.Lock(), asyncio.Lock()
        self._master = None if socket is None else MasterFeed(socket)
        note = (lambda _: None) if self._master is None else self._master.note
        self._control = LiveControl(socket if allow_control else None, note)
        self._emulated: EmulatedFeed | None = None
        self._acts: dict[str, Callable[[Body], Row]] = {
            "start": self._start,
            "end": self._end,
            "command": self._command,
            "hold": self._hold,
            "cable": self._cable,
            "axes": self._axes,
            "scope": self._scope,
            "open": _open,
        }
        self.routes = [
            Route("/api/live", self._sources),
            Route("/api/live/stream", self._stream),
            Route("/api/live/signals", self._signals),
            Route("/api/live/machine", self._machine),
            Route("/api/live/document", self._document),
            Route("/api/live/{act}", self._act, methods=["POST"]),
        ]

    def open(self) -> None:
        """Start following ``fsn-master``, or running the emulated devices."""
        if self._master is not None:
            self._master.start()
        if self._runs_emulated:
            self._start({})

    def close(self) -> None:
        """End everything that was started; ``fsn-master`` continues."""
        self._control.close()
        for feed in (self._emulated, self._master):
            if feed is not None:
                feed.close()

    @property
    def may_control(self) -> bool:
        """Whether a page may control the bus."""
        return self._control.turn is not None

    async def _sources(self, _: Request) -> Response:
        emulated = self._emulated
        return JSONResponse(
            {
                "error": "",
                "master": None if self._master is None else printed(self._master.path),
                "run": None if emulated is None else emulated.run,
                "names": None if emulated is None else printed(emulated.names()),
            }
        )

    def _feed(self, source: object) -> LiveFeed:
        found = {"master": self._master, "emulated": self._emulated}.get(str(source))
        if found is None:
            raise InputError("nothing is live there: start a run, or name a bus with --socket")
        return found

    async def _stream(self, request: Request) -> Response:
        """Send updates of a source, including data missing in the page, until it disconnects."""
        try:
            feed = self._feed(request.query_params.get("source"))
        except FsnError as exc:
            return _refused(exc)
        since = request.query_params.get("since", "")
        # A long number costs quadratic time in `int`, and no run has that many events.
        known = int(since) if since.isascii() and since.isdigit() and len(since) < 16 else 0
        run = request.query_params.get("run")
        return StreamingResponse(
            # Event numbers belong to one run: in another run the page starts from the first event.
            self._pictures(feed, known if run == feed.run else 0),
            media_type="text/event-stream",
        )

    async def _pictures(self, feed: LiveFeed, event: int) -> AsyncIterator[str]:
        picture, choice, row, silent_s = 0, -1, 0, 0.0
        with feed.listening():
            # If another run has replaced it, the page requests it again.
            while not self._ended() and feed in (self._master, self._emulated):
                if feed.picture != picture:
                    picture, silent_s = feed.picture, 0.0
                    # Creating the message of a large run takes time and must not block other pages.
                    message, event, choice, row = await run_in_threadpool(
                        feed.message, event, choice, row
                    )
                    if feed is self._master:
                        message["control"] = self._control.turn
                    yield f"data: {json.dumps(message, separators=(',', ':'))}\n\n"
                # Proxies close a stream without data; a comment line keeps it open.
                elif silent_s >= _SILENCE_S:
                    silent_s = 0.0
                    yield ": still there\n\n"
                await asyncio.sleep(_POLL_S)
                silent_s += _POLL_S

    async def _signals(self, request: Request) -> Response:
        try:
            feed = self._feed(request.query_params.get("source"))
            rows = await run_in_threadpool(feed.signals)
        except FsnError as exc:
            return _refused(exc)
        return JSONResponse({"error": "", "signals": printed(rows)})

    async def _machine(self, request: Request) -> Response:
        try:
            feed = self._feed(request.query_params.get("source"))
            row = await run_in_threadpool(feed.machine)
        except FsnError as exc:
            return _refused(exc)
        return JSONResponse({"error": "", "machine": printed(row)})

    async def _document(self, request: Request) -> Response:
        try:
            feed = self._feed(request.query_params.get("source"))
            document = await run_in_threadpool(feed.document)
        except FsnError as exc:
            return _refused(exc)
        return Response(
            json.dumps(document, indent=2, ensure_ascii=False) + "\n",
            media_type="application/json",
            headers={"content-disposition": f'attachment; filename="{feed.source}-run.json"'},
        )

    async def _act(self, request: Request) -> Response:
        name = request.path_params["act"]
        controls = name in self._control.acts
        act = self._control.acts[name] if controls else self._acts.get(name)
        if act is None:
            return JSONResponse({"error": "unknown request"}, 404)
        try:
            body = await request.json()
        except (ValueError, UnicodeDecodeError, RecursionError):
            return JSONResponse({"error": "the request is not valid JSON"}, 400)
        if not isinstance(body, dict):
            return JSONResponse({"error": "the request is not a JSON object"}, 400)
        try:
            # One after another, so that presses keep their order. A starting run does not delay a
            # lease.
            async with self._controlling if controls else self._starting:
                answer = await run_in_threadpool(act, body)
        except FsnError as exc:
            return _refused(exc)
        return JSONResponse({"error": "", **answer})

    # -- requests of a page ------------------------------------------------------------------------

    def _start(self, _: Body) -> Row:
        checked = self._workspace.checked
        network = whole_network(checked, "nothing started")
        feed = EmulatedFeed(network, content_of(checked), self._scan())
        if self._emulated is not None:
            self._emulated.close()
        self._emulated = feed
        feed.start()
        return {"run": feed.run, "names": printed(feed.names())}

    def _end(self, _: Body) -> Row:
        if self._emulated is not None:
            self._emulated.close()
        return {}

    def _command(self, body: Body) -> Row:
        lines = body.get("lines")
        if not _are_texts(lines) or not 0 < len(lines) <= _MOST_LINES:
            raise InputError(f"lines are 1 to {_MOST_LINES} commands")
        self._started().command(lines)
        return {}

    def _hold(self, body: Body) -> Row:
        ms = body.get("ms")
        if type(ms) is not int or not 0 < ms <= MOST_HELD_MS:
            raise InputError(f"frames are held for 1 to {MOST_HELD_MS} ms, a whole number")
        self._started().hold(ms)
        return {}

    def _cable(self, body: Body) -> Row:
        number, whole = body.get("number"), body.get("whole")
        if type(number) is not int or type(whole) is not bool:
            raise InputError("number is that of a cable, whole is true or false")
        self._started().set_cable(number, whole=whole)
        return {}

    def _axes(self, body: Body) -> Row:
        run = body.get("run")
        if type(run) is not bool:
            raise InputError("run is true or false")
        self._started().turn_axes(run=run)
        return {}

    def _started(self) -> EmulatedFeed:
        if self._emulated is None:
            raise InputError("no run has been started")
        return self._emulated

    def _scope(self, body: Body) -> Row:
        names = body.get("signals")
        if not _are_texts(names):
            raise InputError("signals is a list of names")
        self._feed(body.get("source")).choose(names)
        return {}


def _are_texts(value: object) -> TypeGuard[list[str]]:
    return isinstance(value, list) and all(isinstance(row, str) for row in value)


def _open(body: Body) -> Row:
    """Return the view of a recorded run whose text the page has sent."""
    text = body.get("text")
    if not isinstance(text, str):
        raise InputError("text is missing")
    try:
        document = json.loads(text, parse_constant=_no_number)
    except (ValueError, RecursionError) as exc:
        raise InputError(f"not valid JSON: {exc}") from exc
    view = {"run": "", "source": "file", **recorded_view(document), "scope": None}
    return {"view": printed(view)}


def _no_number(word: str) -> object:
    raise ValueError(f"{word} is not a JSON number")


def _refused(exc: FsnError) -> Response:
    return JSONResponse({"error": printed(str(exc))}, 422)
