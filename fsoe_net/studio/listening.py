"""Settings for access to the studio from other machines: address, certificate, password."""

from __future__ import annotations

import contextlib
import ipaddress
import os
import socket
import ssl
from collections.abc import Iterator
from dataclasses import dataclass

from fsoe_net.errors import EnvironmentFault, InputError
from fsoe_net.studio.connections import LimitedSocket

_LEAST_CHARACTERS = 12
_MOST_CHARACTERS = 1024
_ALL = ("0.0.0.0", "::")  # noqa: S104 - no name of a machine
_ROUNDS = 8  # of a handshake; TLS 1.3 needs two


@dataclass(frozen=True, slots=True, kw_only=True)
class Listening:
    """Address for other machines, and their authentication.

    Attributes:
        address: Name or IP address of this machine.
        certificate: PEM file, with the chain.
        key: PEM file of its key.
        password: Password of the page.
        names: Allowed host names: the address and the names in the certificate.
    """

    address: str
    certificate: str
    key: str
    password: str
    names: tuple[str, ...]

    @classmethod
    def read(cls, address: str, certificate: str, key: str, password_file: str) -> Listening:
        """Read and check the three files.

        Raises:
            InputError: A file cannot be used, or a private file is readable by others; with the
                file and the next step.
        """
        password = _password(password_file)
        # A group may read the key, as `ssl-cert` of Debian does.
        _closed(key, 0o007, "chmod o-rwx")
        names = [_plain(name) for name in _names(certificate, key)]
        own = _plain(address)
        if own not in _ALL:
            names.insert(0, own)
        return cls(
            address=address,
            certificate=certificate,
            key=key,
            password=password,
            names=tuple(dict.fromkeys(names)),
        )


def bound_socket(address: str, port: int) -> socket.socket:
    """Return a socket that listens.

    Raises:
        EnvironmentFault: The address does not belong to this machine, or the port is in use or not
            permitted.
    """
    try:
        row = socket.getaddrinfo(address, port, type=socket.SOCK_STREAM)[0]
        found = LimitedSocket(row[0], row[1])
    except OSError as exc:
        raise EnvironmentFault(f"{address} cannot be listened on: {exc.strerror}") from exc
    # Otherwise the port stays in use for a minute after the last run (TIME_WAIT).
    found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        found.bind(row[4])
        found.listen()
    except OSError as exc:
        found.close()
        where = "of this machine" if address == "127.0.0.1" else f"of {address}"
        raise EnvironmentFault(
            f"port {port} {where} cannot be used: {exc.strerror}; give another --port"
        ) from exc
    return found


@contextlib.contextmanager
def _readable(path: str) -> Iterator[None]:
    try:
        yield
    except OSError as exc:
        raise InputError(f"cannot read {path}: {exc.strerror or exc}") from exc
    except UnicodeDecodeError as exc:
        raise InputError(f"{path} is not UTF-8 text") from exc


def _closed(path: str, bits: int, step: str) -> None:
    """Reject a file that others can read."""
    with _readable(path):
        mode = os.stat(path).st_mode
    if mode & bits:
        raise InputError(f"other users of this machine can read or write {path}: {step} {path}")


def _password(path: str) -> str:
    _closed(path, 0o077, "chmod 600")
    with _readable(path), open(path, encoding="utf-8") as stream:
        password = stream.readline(_MOST_CHARACTERS + 2).rstrip("\r\n")
    if not _LEAST_CHARACTERS <= len(password) <= _MOST_CHARACTERS:
        raise InputError(
            f"the first line of {path} is the password; it has {len(password)} characters, and "
            f"needs {_LEAST_CHARACTERS} to {_MOST_CHARACTERS}: openssl rand -base64 18"
        )
    return password


def _names(certificate: str, key: str) -> list[str]:
    """Return the names in a certificate; a handshake with itself shows that it is usable."""
    # OpenSSL does not name the file in its errors: determine here which one cannot be read.
    for path in (certificate, key):
        with _readable(path), open(path, "rb"):
            pass
    try:
        server = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        server.load_cert_chain(certificate, key, password=lambda: "")  # no prompt
        client = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        client.check_hostname = False
        # The certificate is its own trust anchor here, even if an authority has issued it.
        client.verify_flags |= ssl.VERIFY_X509_PARTIAL_CHAIN
        client.load_verify_locations(certificate)
        rows = _shaken(server, client).get("subjectAltName", ())
    except ssl.SSLCertVerificationError as exc:
        raise InputError(f"{certificate}: {exc.verify_message}; have a new one made") from exc
    except ssl.SSLError as exc:
        why = (exc.reason or str(exc)).lower().replace("_", " ")
        raise InputError(
            f"{certificate} and {key} are not a certificate (PEM) with its key without passphrase: "
            f"{why}"
        ) from exc
    # A wildcard is not an address that a person can open.
    names = [name for kind, name in rows if kind in ("DNS", "IP Address") and "*" not in name]
    if not names:
        raise InputError(
            f"{certificate} names no machine (subjectAltName): have one made with "
            "-addext subjectAltName=DNS:NAME"
        )
    return names


def _shaken(server: ssl.SSLContext, client: ssl.SSLContext) -> dict[str, tuple[tuple[str, str]]]:
    there, back = ssl.MemoryBIO(), ssl.MemoryBIO()
    ends = (client.wrap_bio(back, there), server.wrap_bio(there, back, server_side=True))
    for end in ends * _ROUNDS:
        with contextlib.suppress(ssl.SSLWantReadError):
            end.do_handshake()
    return dict(ends[0].getpeercert() or {})  # type: ignore[arg-type]


def _plain(name: str) -> str:
    try:
        return str(ipaddress.ip_address(name))
    except ValueError:
        return name.lower().rstrip(".")
