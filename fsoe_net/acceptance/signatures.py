"""Signatures of an acceptance record: the signers, and whether the record is unchanged."""

from __future__ import annotations

import datetime
import os
from collections.abc import Iterator
from dataclasses import dataclass

from fsoe_net.acceptance.sign_off import Refusal
from fsoe_net.acceptance.ssh_signatures import SshSigners, key_of, ssh_sign
from fsoe_net.errors import InputError
from fsoe_net.formats.shared.files import read_source, replaced_files
from fsoe_net.formats.shared.limits import MAX_LARGE_BYTES, MAX_RECORD_BYTES
from fsoe_net.formats.shared.write_files import STDOUT, write_whole
from fsoe_net.model.acceptance import Acceptance, CheckedSignature, SignedBy
from fsoe_net.model.network import SourceFile
from fsoe_net.model.written import principal_of
from fsoe_net.project.known import AcceptedRecord, read_record

ROLES = ("author", "verifier")
_MOST_BYTES = 1 << 16
_AS_SIGNED = "take it as it was signed, or have the record made and signed again"


@dataclass(frozen=True, slots=True, kw_only=True)
class SignedRecord:
    """A record with its valid signatures and all objections to it."""

    path: str
    record: AcceptedRecord
    signatures: tuple[CheckedSignature, ...]
    refusals: tuple[Refusal, ...]


def sign_record(path: str, role: str, key: str, *, overwrite: bool) -> CheckedSignature:
    """Write a person's signature of a record next to it.

    Args:
        path: The record.
        role: One of `ROLES`.
        key: File of an SSH key.
        overwrite: Whether to replace an existing signature.

    Raises:
        InputError: The record cannot be signed, or the signature already exists.
        EnvironmentFault: ``ssh-keygen`` is missing, or the file cannot be written.
    """
    found, data = _read(path)
    wrong = next(_changed(found.record, path), None)
    if wrong is not None:
        raise InputError(f"nothing signed: {wrong.what}; {wrong.fix}")
    person = _person(found.record, role)
    principal = _principal(role, person)
    signature, made_by = ssh_sign(data, key)
    _refuse_key_of_other(path, data, role, made_by)
    write_whole(_signature_path(path, role), signature, overwrite=overwrite)
    return CheckedSignature(
        role=role, name=person.name, principal=principal, date=person.date, key=made_by
    )


def _refuse_key_of_other(path: str, data: bytes, role: str, made_by: str) -> None:
    """Raise `InputError` if the same key has signed the record in the other role."""
    (other,) = (name for name in ROLES if name != role)
    try:
        _, signature = read_source(_signature_path(path, other), most=_MOST_BYTES)
    except InputError:  # not signed yet; a damaged file is found by the check
        return
    if key_of(data, signature) == made_by:
        raise InputError(
            f"nothing signed: {made_by} has signed as {other}; the {role} is another person, and "
            "signs with a key of their own"
        )


def check_signatures(path: str, signers: SshSigners) -> SignedRecord:
    """Check the signatures of a record, and the files listed in it by SHA-256.

    Raises:
        InputError: The record cannot be read, or is inconsistent.
        EnvironmentFault: The program that checks signatures is not installed.
    """
    found, data = _read(path)
    signatures: list[CheckedSignature] = []
    refusals: list[Refusal] = []
    for role in ROLES:
        try:
            signatures.append(_checked(path, data, role, _person(found.record, role), signers))
        except InputError as exc:
            refusals.append(Refusal(what=str(exc), fix=_next(path, role)))
    refusals += _alike(signatures)
    refusals += _changed(found.record, path)
    return SignedRecord(
        path=path, record=found, signatures=tuple(signatures), refusals=tuple(refusals)
    )


def _read(path: str) -> tuple[AcceptedRecord, bytes]:
    """Return a record and its bytes, read once: the checked bytes are the signed ones."""
    if path == STDOUT:
        raise InputError("name the record by its file: the signatures are next to it")
    _, data = read_source(path, most=MAX_RECORD_BYTES)
    with replaced_files({path: data}):
        return read_record(path), data


def _signature_path(path: str, role: str) -> str:
    return f"{path}.{role}.sig"


def _next(path: str, role: str) -> str:
    again = " --overwrite" if os.path.exists(_signature_path(path, role)) else ""
    return f"`fsoe-net acceptance sign {path} --key KEY --as {role}{again}` by that person"


def _person(record: Acceptance, role: str) -> SignedBy:
    return record.author if role == "author" else record.verifier


def _principal(role: str, person: SignedBy) -> str:
    found = principal_of(person.name)
    if not found:
        raise InputError(
            f"the {role} {person.name!r} has no principal after the name; make the record with "
            f'--{role} "NAME <PRINCIPAL>", as the file of allowed signers has it'
        )
    return found


def _checked(
    path: str, data: bytes, role: str, person: SignedBy, signers: SshSigners
) -> CheckedSignature:
    principal = _principal(role, person)
    if person.date > datetime.date.today().isoformat():
        raise InputError(f"the {role} {person.name} signed on {person.date}, a day to come")
    signature_path = _signature_path(path, role)
    try:
        _, signature = read_source(signature_path, most=_MOST_BYTES)
    except InputError as exc:
        raise InputError(f"no signature of the {role} {person.name}: {_why(exc)}") from exc
    try:
        key = signers.key_of(data, signature, principal=principal, day=person.date)
    except InputError as exc:
        raise InputError(
            f"{signature_path} is not a signature of {path} by {person.name}: {exc}"
        ) from exc
    return CheckedSignature(
        role=role, name=person.name, principal=principal, date=person.date, key=key
    )


def _why(exc: InputError) -> str:
    return exc.diagnostics[0].message if exc.diagnostics else str(exc)


def _alike(signatures: list[CheckedSignature]) -> Iterator[Refusal]:
    if len(signatures) != len(ROLES):
        return
    author, verifier = signatures  # one principal for both roles is FSN163
    if author.key == verifier.key:
        fix = "a person other than the author must verify, and sign with a key of their own"
        yield Refusal(what=f"author and verifier signed with one key: {author.key}", fix=fix)


def _changed(record: Acceptance, path: str) -> Iterator[Refusal]:
    """Yield each report, test record and attachment that differs from what was signed."""
    folder = os.path.realpath(os.path.dirname(path) or ".")
    for source in (*record.reports, record.test_record, *record.attachments):
        why = _difference(source, folder)
        if why:
            yield Refusal(what=f"{source.path}: {why}", fix=_AS_SIGNED)


def _difference(source: SourceFile, folder: str) -> str:
    whole = os.path.realpath(os.path.join(folder, source.path))
    if os.path.commonpath([whole, folder]) != folder:
        return "it is not in the folder of the record, or leads out of it"
    try:
        found, _ = read_source(whole, most=MAX_LARGE_BYTES)
    except InputError as exc:
        return _why(exc)
    if found.sha256 == source.sha256:
        return ""
    return f"not the file that was signed: SHA-256 {found.sha256}, in the record {source.sha256}"
