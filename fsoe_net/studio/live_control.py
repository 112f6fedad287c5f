"""Control of a bus driven by ``fsn-master`` from the live page."""

from __future__ import annotations

import hmac
import secrets
import time
from collections.abc import Callable
from functools import partial

from fsoe_net.errors import ControlRefused, EnvironmentFault, InputError
from fsoe_net.live.client import Client
from fsoe_net.live.console.names import batches
from fsoe_net.live.control_values import BusState, Symbol, Value
from fsoe_net.studio.live_rows import Row

LEASE_MS = 2000
"""Silence of the page after which its outputs take their stop values."""

Body = dict[str, object]


class LiveControl:
    """Gives control to one page at a time, through one separate client for all pages.

    Only requests of that page renew the lease of this client. If the page, its browser or this
    server fails, ``fsn-master`` itself lets the outputs fall back.

    Args:
        path: Control socket; ``None`` for no control.
        note: Adds a line to the events of the page.

    Attributes:
        acts: Requests by name; each takes the body sent by the page.
    """

    def __init__(self, path: str | None, note: Callable[[str], None]) -> None:
        self._path, self._note = path, note
        self._client: Client | None = None
        self._token, self._turn, self._until = "", 0, 0.0
        self._armed: dict[str, int] = {}  # the exact last setting, as the image is a cycle late
        jobs: dict[str, Callable[[Client, Body], Row]] = {
            "keep-control": _outputs,
            "set-output": self._set,
            "arm-output": self._arm,
            "start-bus": partial(self._bus, "start", Client.start),
            "stop-bus": partial(self._bus, "stop", Client.stop),
            "restart-bus": partial(self._bus, "restart", Client.restart),
            "give-control": self._give,
        }
        self.acts: dict[str, Callable[[Body], Row]] = {
            "take-control": self._take,
            **{name: partial(self._do, job) for name, job in jobs.items()},
        }

    @property
    def turn(self) -> int | None:
        """Number of the page in control, 0 for none; ``None`` if control is not permitted."""
        if self._path is None:
            return None
        return self._turn if self._client is not None and time.monotonic() < self._until else 0

    def close(self) -> None:
        """End control; outputs fall back."""
        if self._client is not None:
            self._client.close()
        self._client = None

    def _take(self, _: Body) -> Row:
        if self._path is None:
            raise InputError(
                "this page only reads the bus; fsoe-net studio --allow-control lets it do more"
            )
        if self.turn:
            raise InputError(
                "another page has control; it ends when that page gives it back, is closed or "
                "hidden"
            )
        self.close()
        client = Client(self._path)
        try:
            access = str(client.hello.get("access", ""))
            if access == "observer":
                raise InputError(
                    "your role at this fsn-master is observer, which only reads. The user who "
                    "runs it gives another one: --allow-user NAME:operator may set outputs, "
                    "NAME:maintainer also start and stop the bus"
                )
            client.lease(LEASE_MS)
        except BaseException:
            client.close()
            raise
        self._client, self._token, self._armed = client, secrets.token_urlsafe(16), {}
        self._turn, self._until = self._turn + 1, time.monotonic() + LEASE_MS / 1000
        self._note("takes control")
        return {"token": self._token, "turn": self._turn, "access": access, "lease_ms": LEASE_MS}

    def _do(self, job: Callable[[Client, Body], Row], body: Body) -> Row:
        """Execute a request of the page in control, which renews its lease."""
        # Not a str, because `compare_digest` accepts only ASCII in texts.
        token = str(body.get("token")).encode(errors="replace")
        if self._client is None or not hmac.compare_digest(token, self._token.encode()):
            raise InputError("this page does not have control; take it first")
        now = time.monotonic()
        # The page renews while it is visible. A late renewal must not restore outputs that fell
        # back.
        if now >= self._until:
            self.close()
            raise InputError(
                f"control has ended: the page was hidden or silent for {LEASE_MS / 1000:g} s, and "
                "what it had set took its stop values"
            )
        self._until = now + LEASE_MS / 1000
        try:
            return job(self._client, body)
        # A refusal does not change the lease; a broken connection ends it.
        except ControlRefused:
            raise
        except EnvironmentFault as fault:
            self.close()
            raise EnvironmentFault(f"control has ended: {fault}") from fault

    def _set(self, client: Client, body: Body) -> Row:
        name, value = _words(body)
        if name in self._armed:
            raise InputError(f"{name} can restart a machine; it is armed for each change")
        client.set({name: value})
        self._note(f"sets {name} to {value}")
        return {}

    def _arm(self, client: Client, body: Body) -> Row:
        """Arm an output and set it, so that no output stays armed: a change uses up the arming."""
        name, text = _words(body)
        outputs = (s for s in client.symbols() if s.is_output)
        symbol = next((s for s in outputs if s.name == name), None)
        if symbol is None or not symbol.restart_relevant:
            raise InputError(f"{name!r} is not an output that is armed")
        # Until it is written, the output has its stop value.
        value, present = _number(symbol, text), symbol.stop_value
        if symbol.client == client.hello.get("client"):
            # Only values written by this client are known: values of another client may have
            # changed.
            present = self._armed.get(name, present)
        # The stop value needs no arming: stopping must always be possible.
        arms = value not in (present, symbol.stop_value)
        if arms:
            client.arm(name)
        try:
            client.set({name: value})
        # An error, not a refusal: it ends control, so that the arming does not apply to the next
        # value.
        except ControlRefused as refused:
            raise EnvironmentFault(f"nothing stays armed: {refused}") from refused
        self._armed[name] = value
        self._note(f"arms {name} and sets it to {value}" if arms else f"sets {name} to {value}")
        return {}

    def _bus(
        self, word: str, request: Callable[[Client], BusState], client: Client, _: Body
    ) -> Row:
        state = request(client)
        self._note(f"requests {word} of the bus")
        return {"state": state.value}

    def _give(self, _: Client, __: Body) -> Row:
        self.close()
        self._note("gives control back")
        return {}


def _outputs(client: Client, _: Body) -> Row:
    """Return the outputs that a client may write; ``why`` if they cannot be read now."""
    try:
        symbols = [s for s in client.symbols() if s.open]
        values: dict[str, Value] = {}
        # Batches, because a request of fsn-master is limited in names and bytes.
        for names in batches(s.name for s in symbols):
            values |= client.get(*names).outputs
    except ControlRefused as refused:
        return {"outputs": [], "why": str(refused)}
    me = client.hello.get("client")
    return {"outputs": [_row(s, values[s.name], me) for s in symbols], "why": ""}


def _row(symbol: Symbol, value: Value, me: object) -> Row:
    return {
        "name": symbol.name,
        "kind": symbol.kind if symbol.kind == "bool" else f"{symbol.kind}{symbol.bits}",
        # As text, because numbers of the page have 53 bits.
        "value": _shown(value),
        "stop_value": _shown(symbol.stop_value),
        "restart_relevant": symbol.restart_relevant,
        "client": symbol.client,
        "mine": symbol.client is not None and symbol.client == me,
    }


def _shown(value: Value) -> str:
    if value is None:
        return "not a number"
    return str(int(value) if value in (0, 1) else value)


def _words(body: Body) -> tuple[str, str]:
    """Return the name of an output and its value, valid for a line of the socket."""
    name, value = body.get("name"), body.get("value")
    if not isinstance(name, str) or not isinstance(value, str):
        raise InputError("name and value are texts")
    words = value.split()
    text = f"{name}{value.strip()}"
    # "=" and blanks separate words of a request; they could select another output.
    if len(words) != 1 or "=" in value or not text.isprintable() or len(text) > 1000:
        raise InputError("give a value as one word, such as 1, 0x0f or 2.5")
    return name, words[0]


def _number(symbol: Symbol, text: str) -> int:
    """Return an integer that is valid for an output, before it is armed."""
    least, most = 0, (1 << symbol.bits) - 1
    if symbol.kind == "signed":
        least, most = -(most + 1) // 2, most // 2
    try:
        value = int(text, 0)
    except ValueError:
        value = most + 1
    if not least <= value <= most:
        raise InputError(f"{symbol.name} takes a whole number from {least} to {most}")
    return value
