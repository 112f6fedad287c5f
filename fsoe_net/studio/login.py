"""Access to the page from other machines by password; wrong passwords delay the next attempt."""

from __future__ import annotations

import asyncio
import hashlib
import hmac
import secrets
from dataclasses import dataclass, field
from html import escape
from time import monotonic
from urllib.parse import parse_qs

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import HTMLResponse, RedirectResponse, Response

from fsoe_net.studio.connections import client_network

LOGIN = "/login"
_BODY_LIMIT = 16_384
_SESSION_S = 24 * 3600.0
_MOST_SESSIONS = 32
_FIRST_WAIT_S, _LONGEST_WAIT_S = 0.5, 60.0
_MOST_ADDRESSES = 1000
_MOST_TRIES = 4  # that wait for their turn: one password is hashed at a time, which needs 16 MiB
_HEADERS = {
    "content-security-policy": "default-src 'none'; style-src 'self'; base-uri 'none'; "
    "form-action 'self'; frame-ancestors 'none'",
    "referrer-policy": "same-origin",  # otherwise forms send no origin
}


@dataclass(slots=True)
class _Wrong:
    """Wrong passwords from one address."""

    count: int = 0
    until: float = 0.0


@dataclass(slots=True)
class Login:
    """Sessions of browsers that entered the password.

    Args:
        password: The password; only its hash is kept.
        cookie: Name of the cookie.
    """

    password: str
    cookie: str
    _salt: bytes = field(default_factory=lambda: secrets.token_bytes(16))
    _hash: bytes = b""
    _sessions: dict[str, float] = field(default_factory=dict)
    _wrong: dict[str, _Wrong] = field(default_factory=dict)
    _tries: int = 0
    _turn: asyncio.Lock = field(default_factory=asyncio.Lock)

    def __post_init__(self) -> None:
        """Discard the password itself."""
        self._hash, self.password = self._hashed(self.password), ""

    def knows(self, session: str) -> bool:
        """Whether a cookie belongs to a session that has not ended."""
        now = monotonic()
        return any(
            hmac.compare_digest(session.encode(), known.encode()) and now < end
            for known, end in self._sessions.items()
        )

    async def answer(self, request: Request) -> Response:
        """Show the page that asks for the password, or accept one."""
        if request.method != "POST":
            return _page("")
        length = request.headers.get("content-length", "")
        # Checked before the body is read.
        if not length.isdecimal() or int(length) > _BODY_LIMIT:
            return _page("the request is too long", 413)
        # A login from a page of another site would open a session that its owner did not want.
        if request.headers.get("origin") is None:
            return _page("log in from this page only", 403)
        fields = parse_qs((await request.body()).decode("utf-8", "replace"))
        wrong = self._wrong_of("" if request.client is None else request.client.host)
        wait = wrong.until - monotonic()
        # The right password also waits: otherwise guessing in parallel would be free.
        if wait > 0:
            return _page(f"not tried: wait {wait:.0f} s after a wrong password", 429)
        # Hashing is deliberately slow; a queue of attempts would block all users.
        if self._tries >= _MOST_TRIES:
            return _page("not tried: too many log in at once; try again", 429)
        # Counted before the result is known, so that parallel attempts gain nothing.
        wrong.until = monotonic() + min(_LONGEST_WAIT_S, _FIRST_WAIT_S * 2**wrong.count)
        wrong.count = min(wrong.count + 1, 16)
        self._tries += 1
        try:
            # One hash at a time, because it deliberately uses much memory.
            async with self._turn:
                given = await run_in_threadpool(self._hashed, fields.get("password", [""])[0])
        # In `finally`: a client that disconnects must not use up an attempt permanently.
        finally:
            self._tries -= 1
        if not hmac.compare_digest(given, self._hash):
            return _page("this is not the password", 403)
        wrong.count, wrong.until = 0, 0.0
        answer = RedirectResponse("/", status_code=303)
        session = self._begin()
        answer.set_cookie(
            self.cookie, session, path="/", secure=True, httponly=True, samesite="strict"
        )
        return answer

    def _begin(self) -> str:
        session = secrets.token_urlsafe(32)
        self._sessions[session] = monotonic() + _SESSION_S
        while len(self._sessions) > _MOST_SESSIONS:
            # The first key is the oldest, because a dictionary keeps the order.
            del self._sessions[next(iter(self._sessions))]
        return session

    def _wrong_of(self, address: str) -> _Wrong:
        client = client_network(address)
        found = self._wrong.pop(client, _Wrong())
        self._wrong[client] = found  # the latest entries are last
        while len(self._wrong) > _MOST_ADDRESSES:
            del self._wrong[next(iter(self._wrong))]
        return found

    def _hashed(self, password: str) -> bytes:
        return hashlib.scrypt(password.encode(), salt=self._salt, n=2**14, r=8, p=1)


def _page(said: str, status: int = 200) -> Response:
    alert = f'<p class="error" role="alert">{escape(said)}</p>' if said else ""
    text = f"""<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<title>fsoe-net studio</title>
<link rel="stylesheet" href="/assets/style.css">
<main class="login">
<h1>fsoe-net studio</h1>{alert}
<form method="post" action="{LOGIN}">
<label for="password">Password, as in the password file</label>
<input id="password" name="password" type="password" autocomplete="current-password" autofocus>
<button class="save">Open</button>
</form>
</main>
</html>
"""
    return HTMLResponse(text, status, _HEADERS)
