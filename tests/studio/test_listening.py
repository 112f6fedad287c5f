"""Other machines: TLS, a password, and nothing without them."""

from __future__ import annotations

import asyncio
import contextlib
import http.client
import shutil
import signal
import socket
import ssl
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote

import pytest
from click.testing import CliRunner
from patience import PATIENCE_S
from starlette.responses import PlainTextResponse
from starlette.types import Message
from studio.server_rig import Studio
from tied import tied

from fsoe_net.cli.main import cli
from fsoe_net.errors import EnvironmentFault, InputError
from fsoe_net.studio import login
from fsoe_net.studio.guard import Guard
from fsoe_net.studio.listening import Listening, bound_socket
from fsoe_net.studio.workspace import Workspace

EXAMPLES = Path(__file__).parents[2] / "examples"
PASSWORD = "correct horse battery"
pytestmark = pytest.mark.skipif(shutil.which("openssl") is None, reason="needs openssl")


def _certificate(folder: Path, name: str, *more: str) -> tuple[str, str]:
    cert, key = (str(folder / f"{name}.{kind}.pem") for kind in ("cert", "key"))
    command = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256"]
    command += ["-nodes", "-subj", "/CN=cell", "-keyout", key, "-out", cert, *more]
    subprocess.run(command, check=True, capture_output=True)
    return cert, key


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str, str]:
    folder = tmp_path_factory.mktemp("tls")
    names = "subjectAltName=DNS:Cell.Local,DNS:*.example,IP:127.0.0.1,IP:::1"
    cert, key = _certificate(folder, "good", "-addext", names)
    password = folder / "password"
    password.write_text(f"{PASSWORD}\n")
    password.chmod(0o600)
    return cert, key, str(password)


class Remote:
    """A browser at another machine."""

    def __init__(self, url: str, certificate: str) -> None:
        self.port = int(url.split(":")[2].strip("/"))
        self.cookie: str | None = None
        self._context = ssl.create_default_context(cafile=certificate)

    def ask(
        self, path: str, method: str = "GET", body: str | None = None, **headers: str | None
    ) -> tuple[int, http.client.HTTPMessage, str]:
        sent: dict[str, str | None] = {"Cookie": self.cookie, "Host": f"127.0.0.1:{self.port}"}
        sent |= {name.replace("_", "-"): value for name, value in headers.items()}
        connection = http.client.HTTPSConnection("127.0.0.1", self.port, context=self._context)
        try:
            given = {name: value for name, value in sent.items() if value is not None}
            connection.request(method, path, body, given)
            answer = connection.getresponse()
            return answer.status, answer.headers, answer.read().decode()
        finally:
            connection.close()

    def log_in(self, password: str, **headers: str | None) -> tuple[int, str]:
        own: dict[str, str | None] = {"Origin": f"https://127.0.0.1:{self.port}"} | headers
        body = f"password={quote(password)}"
        status, found, text = self.ask("/login", "POST", body, **own)
        if status == 303:
            self.cookie = found["Set-Cookie"]
        return status, text


@pytest.fixture(scope="module")
def studio(
    files: tuple[str, str, str], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Studio]:
    folder = tmp_path_factory.mktemp("cell") / "estop"
    shutil.copytree(EXAMPLES / "estop", folder)
    workspace = Workspace(str(folder / "network.yaml"))
    studio = Studio(workspace, remote=Listening.read("127.0.0.1", *files))
    thread = threading.Thread(target=studio.run, daemon=True)
    thread.start()
    yield studio
    studio.stop()
    thread.join()


@pytest.fixture
def remote(studio: Studio, files: tuple[str, str, str]) -> Remote:
    return Remote(studio.url, files[0])


def test_the_password_opens_the_page(remote: Remote) -> None:
    status, headers, _ = remote.ask("/")
    assert (status, headers["Location"]) == (303, "/login")
    for where in ("/api/state", "/records/report", "/assets/app.js"):
        status, _, text = remote.ask(where)
        assert (status, text) == (401, "fsoe-net studio: load the page again, and log in\n")
    status, headers, text = remote.ask("/login")
    assert status == 200
    assert 'type="password"' in text
    assert "form-action 'self'" in headers["Content-Security-Policy"]
    assert "script-src" not in headers["Content-Security-Policy"]
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert remote.ask("/assets/style.css")[0] == 200
    assert remote.log_in(PASSWORD)[0] == 303
    assert remote.cookie is not None
    assert remote.cookie.startswith(f"__Host-fsoe_net_{remote.port}=")
    for word in ("HttpOnly", "Path=/", "SameSite=strict", "Secure"):
        assert word in remote.cookie
    assert "Domain" not in remote.cookie
    remote.cookie = remote.cookie.partition(";")[0]
    assert remote.ask("/api/state")[0] == 200
    assert "script-src 'self'" in remote.ask("/")[1]["Content-Security-Policy"]
    own = {"Origin": f"https://127.0.0.1:{remote.port}", "X_Fsoe_Net": "1"}
    assert remote.ask("/api/undo", "POST", '{"version": 1}', **own)[0] == 200
    assert remote.ask("/api/undo", "POST", '{"version": 1}', **own | {"X_Fsoe_Net": None})[0] == 403
    remote.cookie = remote.cookie[:-1] + "\u00e4"
    assert remote.ask("/api/state")[0] == 401


@pytest.mark.parametrize(
    ("port", "remote", "host", "status"),
    [
        (443, (["cell.local", "::1"], PASSWORD), "cell.local", 200),
        (443, (["cell.local", "::1"], PASSWORD), "[::1]", 200),
        (443, (["cell.local", "::1"], PASSWORD), "cell.local:443", 200),
        (8443, (["cell.local", "::1"], PASSWORD), "cell.local", 403),
        (443, None, "localhost", 403),  # the default port of HTTP is 80
    ],
)
def test_a_name_without_a_port_has_that_of_https(
    port: int, remote: tuple[list[str], str] | None, host: str, status: int
) -> None:
    guard = Guard(PlainTextResponse(), port=port, body_limit=0, limits={}, remote=remote)
    path = "/" if remote is None else "/assets/style.css"
    scope = {"type": "http", "method": "GET", "path": path, "headers": [(b"host", host.encode())]}
    scope["query_string"] = guard.url.partition("?")[2].encode()
    sent: list[Message] = []

    async def receive() -> Message:
        return {"type": "http.request"}

    async def send(message: Message) -> None:
        sent.append(message)

    asyncio.run(guard(scope, receive, send))
    assert sent[0]["status"] == status


def test_only_its_own_names_and_pages(remote: Remote) -> None:
    port = remote.port
    for host in (f"cell.local:{port}", f"[::1]:{port}", f"CELL.local:{port}"):
        assert remote.ask("/login", Host=host)[0] == 200
    for host in ("127.0.0.1", f"localhost:{port}", f"a.example:{port}", f"*.example:{port}", "x"):
        assert remote.ask("/login", Host=host)[0] == 403
    for origin in (f"http://127.0.0.1:{port}", "https://127.0.0.1", "null", "https://evil.example"):
        assert remote.log_in(PASSWORD, Origin=origin)[0] == 403
    status, text = remote.log_in(PASSWORD, Origin=None)
    assert (status, "log in from this page only" in text) == (403, True)
    own = {"Origin": f"https://127.0.0.1:{port}"}
    assert remote.ask("/login", "POST", "x" * 20_000, **own)[0] == 413


def test_plain_http_is_not_a_way_in(remote: Remote) -> None:
    with socket.create_connection(("127.0.0.1", remote.port), PATIENCE_S) as connection:
        connection.sendall(b"GET /login HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        answer = b""
        with contextlib.suppress(ConnectionResetError):
            answer = connection.recv(100)
        assert not answer.startswith(b"HTTP")


def test_wrong_passwords_make_the_next_one_wait(
    remote: Remote, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = 1000.0
    monkeypatch.setattr(login, "monotonic", lambda: now)
    monkeypatch.setattr(login, "_LONGEST_WAIT_S", 4.0)
    waits = []
    for _ in range(5):
        status, text = remote.log_in("correct horse batterz", X_Forwarded_For="10.0.0.1")
        assert (status, "this is not the password" in text) == (403, True)
        status, text = remote.log_in(PASSWORD, X_Forwarded_For="10.0.0.2")
        assert (status, "not tried: wait" in text) == (429, True)
        waits.append(int(text.partition("wait ")[2].partition(" s")[0]))
        now += waits[-1] + 1
    assert waits == [0, 1, 2, 4, 4]
    assert remote.log_in("")[0] == 403
    now += 61
    assert remote.log_in(PASSWORD)[0] == 303
    remote.cookie = str(remote.cookie).partition(";")[0]
    assert remote.ask("/api/state")[0] == 200
    now += 24 * 3600 + 1
    assert remote.ask("/api/state")[0] == 401


def test_memory_of_other_clients_is_bounded() -> None:
    door = login.Login(PASSWORD, "x")
    assert door.password == ""
    first = door._begin()
    assert door.knows(first)
    for _ in range(40):
        door._begin()
    assert not door.knows(first)
    for n in range(2000):
        door._wrong_of(str(n))
    assert len(door._wrong) == 1000


def test_files_that_cannot_be_used_are_named_with_the_next_step(
    files: tuple[str, str, str], tmp_path: Path
) -> None:
    cert, key, password = files
    other = tmp_path / "password"

    def refused(*given: str) -> str:
        with pytest.raises(InputError) as caught:
            Listening.read("cell.local", *given)
        return str(caught.value)

    assert f"cannot read {other}: No such file" in refused(cert, key, str(other))
    other.write_text(PASSWORD)
    other.chmod(0o640)
    assert f"can read or write {other}: chmod 600 {other}" in refused(cert, key, str(other))
    other.chmod(0o600)
    for text in ("short\n", "x" * 2000, ""):
        other.write_text(text)
        assert "needs 12 to 1024: openssl rand" in refused(cert, key, str(other))
    other.write_bytes(b"\xff" * 20)
    assert f"{other} is not UTF-8 text" in refused(cert, key, str(other))
    missing = str(tmp_path / "missing")
    assert f"cannot read {missing}" in refused(missing, key, password)
    assert "not a certificate (PEM) with its key" in refused(password, key, password)
    open_key = tmp_path / "key.pem"
    shutil.copy(key, open_key)
    open_key.chmod(0o644)
    assert f"chmod o-rwx {open_key}" in refused(cert, str(open_key), password)
    plain, its_key = _certificate(tmp_path, "plain")
    assert "names no machine (subjectAltName)" in refused(plain, its_key, password)
    assert "key values mismatch" in refused(plain, key, password)
    wrong = ("-addext", "extendedKeyUsage=clientAuth", "-addext", "subjectAltName=DNS:a")
    client, its_key = _certificate(tmp_path, "client", *wrong)
    assert "certificate purpose; have a new one made" in refused(client, its_key, password)


def test_every_address_has_the_names_of_the_certificate(files: tuple[str, str, str]) -> None:
    names = ("cell.local", "127.0.0.1", "::1")
    assert Listening.read("0.0.0.0", *files).names == names
    assert Listening.read("Robot", *files).names == ("robot", *names)
    with pytest.raises(EnvironmentFault, match="cannot be listened on"):
        bound_socket("no.such.name.invalid", 0)
    with pytest.raises(EnvironmentFault, match=r"port 0 of 192\.0\.2\.1 cannot be used"):
        bound_socket("192.0.2.1", 0)
    with bound_socket("::1", 0) as found:
        assert found.family is socket.AF_INET6


def test_all_four_options_or_none(files: tuple[str, str, str]) -> None:
    cert, key, password = files
    given = ["studio", str(EXAMPLES / "estop"), "--tls-cert", cert, "--tls-key", key]
    found = CliRunner().invoke(cli, given)
    assert found.exit_code == 2
    assert "--listen, --tls-cert, --tls-key and --password-file go together" in found.output
    given += ["--listen", "192.0.2.1", "--password-file", password]
    found = CliRunner().invoke(cli, given)
    assert isinstance(found.exception, EnvironmentFault)
    assert "port 0 of 192.0.2.1 cannot be used" in str(found.exception)


def test_the_command_lets_other_machines_in(files: tuple[str, str, str]) -> None:
    cert, key, password = files
    given = ("studio", ".", "--no-browser", "--listen", "127.0.0.1", "--tls-cert", cert)
    given += ("--tls-key", key, "--password-file", password)
    with subprocess.Popen(
        tied(sys.executable, "-m", "fsoe_net.cli", *given),
        cwd=EXAMPLES / "estop",
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        url = process.stdout.readline().split()[-1]
        remote = Remote(url, cert)
        assert remote.ask("/api/state")[0] == 401
        assert remote.log_in(PASSWORD)[0] == 303
        process.send_signal(signal.SIGINT)
    assert url.startswith("https://127.0.0.1:")
    assert process.returncode == 0
