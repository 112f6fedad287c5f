"""Access to the studio: one person at one browser of this machine, or with the password.

The page can change files. Therefore other pages of the same browser, other users of the machine and
other machines have no access: a single-use token becomes a cookie that only this origin sends (with
``--listen``, a password over TLS replaces the token); ``Host`` and ``Origin`` must be this server
(DNS rebinding); each write has a header that no form can send; the page runs only code of its own
files.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Mapping, Sequence

from starlette.datastructures import URL, Headers
from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from fsoe_net.studio.login import LOGIN, Login

WRITE_HEADER = "x-fsoe-net"

_POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self'",
        "connect-src 'self'",
        "frame-src 'self'",
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
_OPEN = (LOGIN, "/assets/style.css")  # without a session


class Guard:
    """ASGI middleware that lets one browser in.

    Args:
        app: The protected application.
        port: Port of the server.
        body_limit: Maximum bytes of a request.
        limits: Limits for some paths.
        remote: Names of this machine and the password, if other machines may connect, by TLS.

    Attributes:
        url: Opens the page; with a token, once.
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        port: int,
        body_limit: int,
        limits: Mapping[str, int],
        remote: tuple[Sequence[str], str] | None = None,
    ) -> None:
        self._app = app
        self._limit, self._limits = body_limit, dict(limits)
        names, password = remote or (_NAMES, "")
        self._scheme = "http" if remote is None else "https"
        # An IPv6 address is in brackets in a Host header.
        hosts = [f"[{name}]" if ":" in name else name for name in names]
        self._hosts = {f"{host}:{port}" for host in hosts}
        # Browsers leave out the port of https when it is 443.
        if self._scheme == "https" and port == 443:
            self._hosts |= set(hosts)
        self._cookie = f"fsoe_net_{port}"  # cookies ignore ports, so two studios need two names
        self._login: Login | None = None
        if remote is not None:
            # The prefix `__Host-` makes browsers reject the cookie of another host or of plain
            # http.
            self._cookie = f"__Host-{self._cookie}"
            self._login = Login(password, self._cookie)
        self._session = secrets.token_urlsafe(32)
        self._token = secrets.token_urlsafe(32)
        self.url = f"{self._scheme}://{hosts[0]}:{port}/"
        if remote is None:
            self.url += f"?token={self._token}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve a request, or reject it."""
        # Lifespan messages of the server have no headers to check.
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        request = Request(scope)
        answer = self._refusal(request)
        if answer is None and self._login is not None and request.url.path == LOGIN:
            answer = await self._login.answer(
                # The login reads the body, so its limit must apply before the password is known.
                Request(scope, _limited(receive, self._most(request)))
            )

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                given = [tuple(row) for row in message.get("headers", [])]
                names = {name for name, _ in given}  # a document has its own stricter policy
                own = ((k.encode(), v.encode()) for k, v in _HEADERS.items())
                message["headers"] = [*given, *(row for row in own if row[0] not in names)]
            await send(message)

        await (answer or self._app)(scope, _limited(receive, self._most(request)), send_guarded)

    def _refusal(self, request: Request) -> Response | None:
        headers = request.headers
        # A foreign page can resolve its own name to this address (DNS rebinding); the name reveals
        # it.
        if headers.get("host", "").lower() not in self._hosts:
            return _no("open the address that fsoe-net studio printed: this one has another name")
        # Browsers send Origin with each cross-site request (CSRF); it must be our own.
        origin = headers.get("origin")
        if origin is not None and not self._is_own(origin):
            return _no("a page of another site may not use this one")
        given, path = request.query_params.get("token"), request.url.path
        mine = request.cookies.get(self._cookie, "")
        if self._login is not None:
            if path in _OPEN:
                return None
            if not self._login.knows(mine):
                if path == "/":
                    return RedirectResponse(LOGIN, 303)
                return _no("load the page again, and log in", 401)
        # The token opens one session and is then invalid: an address in a history opens nothing.
        elif given is not None and path == "/":
            return self._let_in(given)
        # Constant-time comparison: the response time must not reveal the token.
        elif not hmac.compare_digest(mine.encode(), self._session.encode()):
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
        # A form of another site cannot send this header without a preflight, which is rejected.
        if headers.get(WRITE_HEADER) != "1" or headers.get("origin") is None:
            return _no("a change comes from the page of fsoe-net studio only")
        length = headers.get("content-length", "")
        # A body without a length could grow without end.
        if not length.isascii() or not length.isdigit() or int(length) > most:
            return _no("the change is too long, or does not say how long it is", 413)
        return None

    def _is_own(self, origin: str) -> bool:
        url = URL(origin)
        return url.scheme == self._scheme and url.netloc.lower() in self._hosts


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
