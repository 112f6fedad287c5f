"""Signatures by ``ssh-keygen``, made with an SSH key and checked against allowed signers.

No shell is involved. Of the user's files, ``ssh-keygen`` opens only the key. All data to check are
read once, here, and are passed in a temporary folder.
"""

from __future__ import annotations

import os
import re
import shutil
import stat
import subprocess
import tempfile
from dataclasses import dataclass
from datetime import date
from pathlib import Path

from fsoe_net.errors import EnvironmentFault, InputError
from fsoe_net.formats.shared.files import read_source

NAMESPACE = "fsoe-net-acceptance"
"""Purpose of an SSH signature (ssh-keygen ``-n``); signatures for other purposes are invalid."""
_MOST_BYTES = 1 << 20
_PATIENCE_S = 60
_KEY = re.compile(r"with (\S+) key (SHA256:[A-Za-z0-9+/=]+)$")


@dataclass(frozen=True, slots=True, kw_only=True)
class SshSigners:
    """Files of allowed signers and of revoked keys, in the formats of ssh-keygen(1)."""

    path: str
    allowed: bytes
    revoked: bytes = b""

    @classmethod
    def read(cls, signers: str, revoked: str | None = None) -> SshSigners:
        """Read the files.

        Raises:
            InputError: A file cannot be read, or has more than 1 MiB.
        """
        _, allowed = read_source(signers, most=_MOST_BYTES)
        held = b"" if revoked is None else read_source(revoked, most=_MOST_BYTES)[1]
        return cls(path=signers, allowed=allowed, revoked=held)

    def key_of(self, data: bytes, signature: bytes, *, principal: str, day: str) -> str:
        """Return type and SHA-256 of the key of a signature.

        Args:
            data: The signed data.
            signature: Detached, as `ssh_sign` returns it.
            principal: The signer, as named in the file of allowed signers.
            day: Day on which the key was valid, at noon (ISO 8601).

        Raises:
            InputError: The signature is invalid.
            EnvironmentFault: ``ssh-keygen`` is missing.
        """
        with tempfile.TemporaryDirectory(prefix="fsn-signed-") as name:
            folder = Path(name)
            # Copies: the files that were read are the ones that are checked.
            (folder / "allowed").write_bytes(self.allowed)
            (folder / "signature").write_bytes(signature)
            given = ["-f", str(folder / "allowed"), "-s", str(folder / "signature")]
            if self.revoked:
                (folder / "revoked").write_bytes(self.revoked)
                given += ["-r", str(folder / "revoked")]
            # At noon: the day is stated without a time zone.
            noon = f"{date.fromisoformat(day).isoformat().replace('-', '')}1200"
            given += ["-I", principal, f"-Overify-time={noon}"]
            done = _keygen("verify", *given, data=data)
            why = done.stderr.decode("utf-8", "replace").replace(f"{name}/", "").split("\n")
        found = _KEY.search(done.stdout.decode("utf-8", "replace").strip())
        if done.returncode == 0 and found is not None:
            return f"{found[1]} {found[2]}"
        words = "; ".join(filter(None, map(str.strip, why)))
        why_not = "is revoked, or not" if self.revoked else "is not"
        raise InputError(words or f"the key {why_not} one of {principal} in {self.path}")


def ssh_sign(data: bytes, key: str) -> tuple[bytes, str]:
    """Sign; ``ssh-keygen`` asks for a passphrase, PIN or touch on the terminal.

    Args:
        data: Data to sign.
        key: File of the private key; of the public key if an agent or a token holds the private
            key.

    Returns:
        The signature, armoured, and type and SHA-256 of the key.

    Raises:
        InputError: The key is not a file, or ``ssh-keygen`` does not sign with it.
        EnvironmentFault: ``ssh-keygen`` is missing.
    """
    try:
        # A device or pipe as key would block or have side effects.
        is_file = stat.S_ISREG(os.stat(key).st_mode)
    except (OSError, ValueError):
        is_file = False
    if not is_file:
        raise InputError(f"{key} is not a file with an SSH key; ssh-keygen -t ed25519 makes one")
    done = _keygen("sign", "-f", os.path.abspath(key), data=data, asks=True)
    if done.returncode != 0:
        words = "see the output of ssh-keygen above"
        raise InputError(f"nothing signed: ssh-keygen does not sign with {key}; {words}")
    # The key of the signature is read back, as an agent may have used another one.
    made_by = key_of(data, done.stdout)
    if made_by is None:
        raise InputError(f"nothing signed: ssh-keygen made no signature with {key} that holds")
    return done.stdout, made_by


def key_of(data: bytes, signature: bytes) -> str | None:
    """Return type and SHA-256 of the key of a signature, or ``None`` if it does not hold.

    Whose key it is remains unknown; see `SshSigners.key_of`.

    Raises:
        EnvironmentFault: ``ssh-keygen`` is missing.
    """
    with tempfile.TemporaryDirectory(prefix="fsn-signed-") as name:
        path = Path(name, "signature")
        path.write_bytes(signature)
        seen = _keygen("check-novalidate", "-s", str(path), data=data)
    found = _KEY.search(seen.stdout.decode("utf-8", "replace").strip())
    return None if seen.returncode != 0 or found is None else f"{found[1]} {found[2]}"


def _keygen(
    what: str, *given: str, data: bytes, asks: bool = False
) -> subprocess.CompletedProcess[bytes]:
    """Run ``ssh-keygen -Y``; there is no time limit while it waits for input from a person."""
    program = shutil.which("ssh-keygen")
    if program is None:
        raise EnvironmentFault(
            "ssh-keygen is not installed, so signatures can be neither made nor checked; install "
            "OpenSSH, on Debian and Ubuntu: apt install openssh-client"
        )
    try:
        return subprocess.run(  # noqa: S603  # a list, no shell
            [program, *(["-q"] if asks else []), "-Y", what, "-n", NAMESPACE, *given],
            input=data,
            stdout=subprocess.PIPE,
            stderr=None if asks else subprocess.PIPE,
            env={**os.environ, "LC_ALL": "C"},
            # A person with a token needs time; a check must end in bounded time.
            timeout=None if asks else _PATIENCE_S,
            check=False,
        )
    except subprocess.TimeoutExpired as exc:
        raise EnvironmentFault(f"ssh-keygen has not answered for {_PATIENCE_S} s") from exc
    except (OSError, ValueError) as exc:
        raise EnvironmentFault(f"ssh-keygen cannot be run: {exc}") from exc
