"""Who may use the studio: one person at one browser of this machine.

The page can change files, so that other pages of the same browser, other users of the machine and
other machines are kept out: a token that counts once becomes a cookie that only this origin sends;
``Host`` and ``Origin`` have to be this server (DNS rebinding); each write has a header that no form
can send; the page runs no code but its own files.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Mapping

from starlette.datastructures import URL, Headers
from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

__all__ = ["WRITE_HEADER", "Guard"]

WRITE_HEADER = "x-fsoe-net"

_POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self'",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
)
_HEADERS = {
    "content-security-policy": _POLICY,
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-store",
}
_NAMES = ("127.0.0.1", "localhost")


class Guard:
    """ASGI middleware that lets one browser in.

    Args:
        app: What is behind it.
        port: On which it is served.
        body_limit: Most bytes of a request.
        limits: The same for some paths.
    """

    def __init__(
        self, app: ASGIApp, *, port: int, body_limit: int, limits: Mapping[str, int]
    ) -> None:
        self._app = app
        self._limit, self._limits = body_limit, dict(limits)
        self._hosts = {f"{name}:{port}" for name in _NAMES}
        self._cookie = f"fsoe_net_{port}"  # cookies do not know ports: two studios, two names
        self._session = secrets.token_urlsafe(32)
        self._token = secrets.token_urlsafe(32)

    def token(self) -> str:
        """Return the token that opens the page once."""
        return self._token

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request, or refuse it."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request = Request(scope)
        answer = self._refusal(request)
        if answer is not None:
            answer.headers.update(_HEADERS)
            await answer(scope, receive, send)
            return

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                own = [(k.encode(), v.encode()) for k, v in _HEADERS.items()]
                message["headers"] = [*message.get("headers", []), *own]
            await send(message)

        await self._app(scope, _limited(receive, self._most(request)), send_guarded)

    def _refusal(self, request: Request) -> Response | None:
        headers = request.headers
        if headers.get("host", "").lower() not in self._hosts:
            return _no("open the address that fsoe-net studio printed: this one has another name")
        origin = headers.get("origin")
        if origin is not None and not self._is_own(origin):
            return _no("a page of another site may not use this one")
        given = request.query_params.get("token")
        if given is not None and request.url.path == "/":
            return self._let_in(given)
        mine = request.cookies.get(self._cookie, "")
        if not hmac.compare_digest(mine.encode(), self._session.encode()):
            return _no(
                "open the address that fsoe-net studio printed; it counts once, in one browser"
            )
        if request.method not in ("GET", "HEAD"):
            return self._refused_write(headers, self._most(request))
        return None

    def _let_in(self, given: str) -> Response:
        if not self._token or not hmac.compare_digest(given.encode(), self._token.encode()):
            return _no("this address was used already; start fsoe-net studio again for a new one")
        self._token = ""
        answer = RedirectResponse("/", status_code=303)
        answer.set_cookie(self._cookie, self._session, httponly=True, samesite="strict", path="/")
        return answer

    def _most(self, request: Request) -> int:
        return self._limits.get(request.url.path, self._limit)

    def _refused_write(self, headers: Headers, most: int) -> Response | None:
        if headers.get(WRITE_HEADER) != "1" or headers.get("origin") is None:
            return _no("a change comes from the page of fsoe-net studio only")
        length = headers.get("content-length", "")
        if not length.isascii() or not length.isdigit() or int(length) > most:
            return _no("the change is too long, or does not say how long it is", 413)
        return None

    def _is_own(self, origin: str) -> bool:
        url = URL(origin)
        return url.scheme == "http" and url.netloc.lower() in self._hosts


def _limited(receive: Receive, most: int) -> Receive:
    got = 0

    async def receive_limited() -> Message:
        nonlocal got
        message = await receive()
        got += len(message.get("body", b""))
        if got > most:
            return {"type": "http.disconnect"}
        return message

    return receive_limited


def _no(text: str, status: int = 403) -> Response:
    return PlainTextResponse(f"fsoe-net studio: {text}\n", status_code=status)
