"""Routes for files uploaded by the browser, and for downloads."""

from __future__ import annotations

from collections.abc import Callable

from starlette.concurrency import run_in_threadpool
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from fsoe_net.errors import FsnError, InputError
from fsoe_net.studio import export
from fsoe_net.studio.uploads import Uploads
from fsoe_net.studio.workspace import StaleVersion, Workspace

UPLOADS = "/api/files"
"""Route for uploaded files."""


def file_routes(workspace: Workspace, uploads: Uploads) -> list[Route]:
    """Return the routes.

    Args:
        workspace: The network in the page.
        uploads: Receives the files.
    """

    async def offers(_: Request) -> Response:
        return await _answered(uploads, uploads.shown)

    async def upload(request: Request) -> Response:
        try:
            refusal = await _received(request, uploads)
        except OSError as exc:
            return _refused(f"the file cannot be kept: {exc.strerror}")
        return await _answered(uploads, uploads.shown) if refusal is None else refusal

    async def clear(_: Request) -> Response:
        await run_in_threadpool(uploads.clear)
        return await _answered(uploads, uploads.shown)

    async def targets(_: Request) -> Response:
        return JSONResponse({"error": "", "targets": await run_in_threadpool(export.targets)})

    async def preview(request: Request) -> Response:
        version, target = _export(request)
        return await _answered(
            uploads,
            lambda: export.preview(workspace, version, target, uploads.esis, named=uploads.place),
        )

    async def download(request: Request) -> Response:
        version, target = _export(request)
        try:
            file = await run_in_threadpool(
                export.download, workspace, version, target, uploads.esis
            )
        except (StaleVersion, FsnError, ValueError) as exc:
            return _refused(_words(exc, uploads.place))
        headers = {"content-disposition": f'attachment; filename="{file.name}"'}
        return Response(file.data, media_type="application/octet-stream", headers=headers)

    return [
        Route("/api/offers", offers),
        Route(UPLOADS, upload, methods=["POST"]),
        Route(f"{UPLOADS}/clear", clear, methods=["POST"]),
        Route("/api/targets", targets),
        Route("/api/export/{target}", preview),
        Route("/api/export/{target}/download", download),
    ]


def _export(request: Request) -> tuple[int, str]:
    version = request.query_params.get("version", "")
    # int() takes quadratic time for a long text.
    number = int(version) if version.isascii() and version.isdigit() and len(version) < 18 else -1
    return number, request.path_params["target"]


async def _received(request: Request, uploads: Uploads) -> Response | None:
    """Receive a file; return the reason if it was rejected."""
    try:
        file = await run_in_threadpool(uploads.begin, request.query_params.get("name", ""))
    except InputError as exc:
        return _refused(str(exc))
    room, got = await run_in_threadpool(uploads.room_bytes), 0
    whole = False
    try:
        async for data in request.stream():
            got += len(data)
            if got > room:
                return _refused("the files together are too large; remove some first", 413)
            await run_in_threadpool(file.write, data)
        whole = True
    except ClientDisconnect:
        return _refused("the file did not come whole")
    finally:
        await run_in_threadpool(file.close, keep=whole)
    await run_in_threadpool(uploads.put, file)
    return None


async def _answered(uploads: Uploads, make: Callable[[], dict[str, object]]) -> Response:
    try:
        return JSONResponse({"error": "", **await run_in_threadpool(make)})
    except (StaleVersion, FsnError, ValueError) as exc:
        return _refused(_words(exc, uploads.place))


def _words(exc: Exception, named: Callable[[str], str]) -> str:
    if isinstance(exc, StaleVersion):
        return "something else has changed meanwhile; look at it, and do it again"
    if not isinstance(exc, InputError):
        return named(str(exc))
    rows = (f"{row.span}: {row.message}" for row in exc.diagnostics[:5])
    return named("; ".join([exc.message, *rows]))


def _refused(text: str, status: int = 422) -> Response:
    return JSONResponse({"error": text}, status)
