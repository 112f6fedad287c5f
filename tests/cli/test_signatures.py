"""Signatures of a record by the real ssh-keygen: two persons, two keys, and every way to cheat."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from cli.signed_folder import ANNA, BERT, RECORD, make_signed, public_key, sign
from cli.tool import fsn

from fsoe_net.acceptance.accept import attachments
from fsoe_net.errors import InputError

pytestmark = pytest.mark.skipif(
    shutil.which("ssh-keygen") is None, reason="signatures are made by ssh-keygen of OpenSSH"
)
VERIFY = ("acceptance", "verify", "timed.yaml", "--acceptance", RECORD, "--signers", "signers")


@pytest.fixture(scope="module")
def master(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_signed(tmp_path_factory.mktemp("signed"))


@pytest.fixture
def folder(master: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copytree(master, tmp_path / "f")
    monkeypatch.chdir(tmp_path / "f")
    return tmp_path / "f"


def refused(*more: str) -> list[str]:
    done = fsn(*VERIFY, *more)
    assert done.returncode == 1, done.stdout
    rows = done.stdout.splitlines()
    return [r.removeprefix("NOT as signed: ") for r in rows if r.startswith("NOT as signed: ")]


def replace(name: str, before: str, after: str) -> None:
    path = Path(name)
    text = path.read_text("utf-8")
    assert before in text
    path.write_text(text.replace(before, after, 1), "utf-8")


@pytest.mark.shows("R15")
def test_two_persons_with_two_keys(folder: Path) -> None:
    done = fsn(*VERIFY)
    assert (done.returncode, done.stderr) == (0, "")
    rows = done.stdout.splitlines()
    assert rows[0].startswith(f"author A. Meier <{ANNA}>, 2021-11-21: signed, ED25519 SHA256:")
    assert rows[1].startswith(f"verifier B. Kaya <{BERT}>, 2021-11-21: signed, ED25519 SHA256:")
    assert rows[2].endswith(f"accepted: {RECORD}")
    assert rows[3].endswith("timed.yaml: the same")
    found = json.loads(fsn(*VERIFY, "--format", "json").stdout)
    assert [row["principal"] for row in found["signatures"]] == [ANNA, BERT]
    assert found["not_as_signed"] == []
    replace("timed.yaml", "connection_id: 11", "connection_id: 12")
    done = fsn(*VERIFY)  # the signatures hold, the network is another one
    assert done.returncode == 1
    assert "NOT as signed" not in done.stdout
    assert fsn("acceptance", "verify", *VERIFY[3:]).returncode == 0  # signatures alone


@pytest.mark.shows("R15")
@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("A. Meier", "A. Maier"),
        ("soldered in", "soldered on"),
        ("by: B. Kaya", "by: B. Kara"),
        ("'2021-11-21'", "'2021-11-22'"),
        ("# Acceptance", "#  Acceptance"),
        ("file: report.html", "file: ./report.html"),
    ],
)
def test_any_byte_of_the_record_counts(folder: Path, before: str, after: str) -> None:
    replace(RECORD, before, after)
    found = refused()
    assert len(found) == 2
    for row, role in zip(found, ("author", "verifier"), strict=True):
        assert row.startswith(f"{RECORD}.{role}.sig is not a signature of {RECORD} by ")
        assert row.endswith("Signature verification failed: incorrect signature")


@pytest.mark.shows("R15")
@pytest.mark.parametrize(
    "name", ["report.html", "report.json", "test-record.yaml", "photos/panel.jpg"]
)
def test_any_byte_of_a_signed_file_counts(folder: Path, name: str) -> None:
    with Path(name).open("ab") as file:
        file.write(b" ")
    (found,) = refused()
    assert found.startswith(f"{name}: not the file that was signed: SHA-256 ")


def missing(folder: Path) -> None:
    (folder / f"{RECORD}.author.sig").unlink()


def swapped(folder: Path) -> None:
    one, two = (folder / f"{RECORD}.{role}.sig" for role in ("author", "verifier"))
    held = one.read_bytes()
    one.write_bytes(two.read_bytes())
    two.write_bytes(held)


def of_another_namespace(folder: Path) -> None:
    sign(folder, "anna", "author", "git")


def of_nobody_we_know(folder: Path) -> None:
    sign(folder, "carl", "author")


def cut_short(folder: Path) -> None:
    path = folder / f"{RECORD}.author.sig"
    path.write_bytes(path.read_bytes()[:60])


def a_pipe(folder: Path) -> None:
    missing(folder)
    os.mkfifo(folder / f"{RECORD}.author.sig")


def huge(folder: Path) -> None:
    os.truncate(folder / f"{RECORD}.author.sig", 1 << 40)


def not_valid_yet(folder: Path) -> None:
    replace("signers", f"{ANNA} ", f'{ANNA} valid-after="20211122" ')


def not_valid_any_more(folder: Path) -> None:
    replace("signers", f"{ANNA} ", f'{ANNA} valid-before="20211121" ')


def for_another_use(folder: Path) -> None:
    replace("signers", f"{ANNA} ", f'{ANNA} namespaces="git" ')


def nobody_allowed(folder: Path) -> None:
    (folder / "signers").write_bytes(b"")


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (missing, ["no signature of the author A. Meier <"]),
        (swapped, ["author.sig is not a signature", "verifier.sig is not a signature"]),
        (of_another_namespace, ["namespace does not match"]),
        (of_nobody_we_know, [f"the key is not one of {ANNA} in signers"]),
        (cut_short, ["Couldn't parse signature"]),
        (a_pipe, ["it is not a regular file"]),
        (huge, ["more than the 65536 allowed"]),
        (not_valid_yet, ["key is not yet valid"]),
        (not_valid_any_more, ["key has expired"]),
        (for_another_use, ["not permitted for use in signature namespace"]),
        (nobody_allowed, [f"not one of {ANNA}", f"not one of {BERT}"]),
    ],
)
def test_a_signature_that_does_not_hold(
    folder: Path, spoil: Callable[[Path], None], words: list[str]
) -> None:
    spoil(folder)
    found = refused()
    assert len(found) == len(words)
    assert [row for word, row in zip(words, found, strict=True) if word not in row] == []


@pytest.mark.shows("R15")
def test_a_revoked_key_does_not_count(folder: Path) -> None:
    (folder / "revoked").write_text(public_key(folder, "bert"))
    (found,) = refused("--revoked", "revoked")
    assert f"revoked, or not one of {BERT}" in found
    (folder / "revoked").write_text(public_key(folder, "carl"))
    assert fsn(*VERIFY, "--revoked", "revoked").returncode == 0


@pytest.mark.shows("R15")
def test_one_principal_is_not_two_persons(folder: Path) -> None:
    replace(RECORD, BERT, ANNA.upper())
    for key, role in (("anna", "author"), ("bert", "verifier")):
        sign(folder, key, role)
    done = fsn(*VERIFY)
    assert (done.returncode, done.stdout) == (1, "")
    assert "error[FSN163]: author and verifier are one person" in done.stderr


@pytest.mark.shows("R15")
def test_one_key_is_not_two_persons(folder: Path) -> None:
    sign(folder, "anna", "verifier")
    (folder / "signers").write_text(f"{ANNA},{BERT} {public_key(folder, 'anna')}")
    (found,) = refused()
    assert found.startswith("author and verifier signed with one key: ED25519 SHA256:")


@pytest.mark.shows("R15")
def test_a_key_that_signed_as_author_does_not_sign_as_verifier(folder: Path) -> None:
    signature = folder / f"{RECORD}.verifier.sig"
    before = signature.read_bytes()
    again = ("acceptance", "sign", RECORD, "--key", "anna", "--as", "verifier", "--overwrite")
    done = fsn(*again)
    assert done.returncode == 1
    assert " has signed as author; the verifier is another person" in done.stderr
    assert signature.read_bytes() == before


def test_the_next_step_replaces_a_signature_that_does_not_hold(folder: Path) -> None:
    sign(folder, "carl", "verifier")
    step = f"`fsoe-net acceptance sign {RECORD} --key KEY --as verifier --overwrite`"
    assert step in fsn(*VERIFY).stdout
    done = fsn("acceptance", "sign", RECORD, "--key", "bert", "--as", "verifier", "--overwrite")
    assert done.returncode == 0
    assert fsn(*VERIFY).returncode == 0


def test_the_report_shows_the_signatures_and_what_was_accepted(folder: Path) -> None:
    given = ("report", "timed.yaml", "--test-record", "test-record.yaml", "--accepted", RECORD)
    done = fsn(*given, "--signers", "signers", "-o", "signed.md")
    assert done.returncode == 0, done.stderr
    text = Path("signed.md").read_text("utf-8")
    for role, who, name in (("author", ANNA, "A. Meier"), ("verifier", BERT, "B. Kaya")):
        assert f"✔ {role} {name} \\<{who}>, 2021-11-21<br>{who}, ED25519 SHA256:" in text
    assert "oscilloscope 4711, calibrated until 2022-03<br>stop watch" in text
    assert "hall 3, 21 degrees" in text
    photo = hashlib.sha256(b"a photo of the panel").hexdigest()
    assert f"| `photos/panel.jpg` | `{photo}` |" in text
    Path(f"{RECORD}.author.sig").unlink()
    Path("photos/panel.jpg").write_bytes(b"another photo")
    done = fsn(*given, "--signers", "signers", "-o", "broken.md")
    assert done.stdout.startswith("broken.md: 2 verdicts against it · machine: ")
    assert "signatures DO NOT HOLD" in done.stdout
    assert "against it: Sign-off: no signature of the author A. Meier" in done.stdout
    assert "against it: Sign-off: photos/panel.jpg: not the file that was signed" in done.stdout
    done = fsn(*given, "-o", "unchecked.md")
    assert "not checked; --signers FILE" in Path("unchecked.md").read_text("utf-8")


def test_attachments_are_in_the_folder_of_the_record(folder: Path) -> None:
    Path("../outside.pdf").write_bytes(b"x")
    Path("link.pdf").symlink_to("../outside.pdf")
    os.mkfifo("pipe")
    for path, words in (
        ("../outside.pdf", "is not in the folder of the record, or leads out of it"),
        ("link.pdf", "is not in the folder of the record, or leads out of it"),
        ("/etc/hostname", "is not in the folder of the record, or leads out of it"),
        ("pipe", "cannot be read"),
        ("photos", "cannot be read"),
        ("none.pdf", "cannot be read"),
    ):
        with pytest.raises(InputError, match=words):
            attachments([path], ".")
    with pytest.raises(InputError, match="is attached twice"):
        attachments(["photos/panel.jpg", "./photos/../photos/panel.jpg"], ".")
    (found,) = attachments(["photos/panel.jpg"], "photos")
    assert found.path == "panel.jpg"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("../report.html", "it is not in the folder of the record, or leads out of it"),
        ("/etc/hostname", "it is not in the folder of the record, or leads out of it"),
        ("link.html", "it is not in the folder of the record, or leads out of it"),
        ("pipe", "it is not a regular file"),
        ("devices", "it is a directory"),
        ("-rf", "no such file"),
        ("x" * 5000, "File name too long"),
    ],
)
def test_files_that_a_record_may_not_name(folder: Path, name: str, words: str) -> None:
    os.mkfifo("pipe")
    Path("link.html").symlink_to("../../report.html")
    replace(RECORD, "file: report.html", f'file: "{name}"')
    for key, role in (("anna", "author"), ("bert", "verifier")):
        sign(folder, key, role)
        done = fsn("acceptance", "sign", RECORD, "--key", key, "--as", role, "--overwrite")
        assert done.returncode == 1
        assert "nothing signed" in done.stderr
    done = fsn(*VERIFY)
    assert done.returncode == 1
    assert done.stdout.count("NOT as signed") == 1
    assert words in done.stdout
    assert len(done.stdout.splitlines()) == 6


@pytest.mark.parametrize("text", ["\\n", "\\e[31m", "\\0", "\\ud800"])
def test_a_name_that_would_make_lines_of_its_own_is_refused(folder: Path, text: str) -> None:
    replace(RECORD, "file: report.html", f'file: "a{text}b"')
    for given in (
        VERIFY,
        ("acceptance", "sign", RECORD, "--key", "anna", "--as", "author", "--overwrite"),
    ):
        done = fsn(*given)
        assert (done.returncode, done.stdout) == (1, "")
        assert f"{RECORD}:33:" in done.stderr
        assert "error[FSN102]" in done.stderr


@pytest.mark.parametrize("author", ["A. Meier", "A. Meier <*>", "A. Meier <-f>"])
def test_a_name_without_a_principal_is_not_signed(folder: Path, author: str) -> None:
    replace(RECORD, f"A. Meier <{ANNA}>", author)
    done = fsn("acceptance", "sign", RECORD, "--key", "anna", "--as", "author", "--overwrite")
    assert done.returncode == 1
    words = f"the author {author!r} has no principal after the name"
    assert words in done.stderr
    sign(folder, "bert", "verifier")
    (found,) = refused()
    assert words in found


def test_a_signature_is_not_replaced_unasked_and_no_day_to_come_counts(folder: Path) -> None:
    done = fsn("acceptance", "sign", RECORD, "--key", "anna", "--as", "author")
    assert done.returncode == 1
    assert f"{RECORD}.author.sig exists" in done.stderr
    replace(RECORD, "date: '2021-11-21'", "date: '2999-11-21'")
    for key, role in (("anna", "author"), ("bert", "verifier")):
        sign(folder, key, role)
    assert refused() == [f"the author A. Meier <{ANNA}> signed on 2999-11-21, a day to come"]


@pytest.mark.parametrize(
    ("given", "code", "words"),
    [
        (
            ("acceptance", "sign", RECORD, "--key", "anna"),
            2,
            "option '--as'",
        ),
        (
            ("acceptance", "sign", RECORD, "--key", "nokey", "--as", "author"),
            1,
            "nokey is not a file with",
        ),
        (
            ("acceptance", "sign", RECORD, "--key", "pipe", "--as", "author"),
            1,
            "pipe is not a file with",
        ),
        (
            ("acceptance", "sign", RECORD, "--key", "signers", "--as", "author"),
            1,
            "does not sign with sign",
        ),
        (
            ("acceptance", "sign", RECORD, "--key", "-v", "--as", "author"),
            1,
            "-v is not a file with an SSH",
        ),
        (
            ("acceptance", "sign", RECORD, "--key", "anna", "--as", "author", "-o", "x"),
            2,
            "No such option",
        ),
        (
            ("acceptance", "record", "timed.yaml"),
            2,
            "option '--report'",
        ),
        (
            ("acceptance", "sign", "pipe", "--key", "anna", "--as", "author"),
            1,
            "it is not a regular file",
        ),
        (
            ("acceptance", "verify", "timed.yaml"),
            2,
            "give either --accepted FILE or --acceptance RECORD",
        ),
        (
            ("acceptance", "verify", "--acceptance", RECORD),
            2,
            "--acceptance RECORD and --signers FILE belong",
        ),
        ((*VERIFY, "--accepted", RECORD), 2, "give either --accepted FILE or --acceptance RECORD"),
        (
            ("acceptance", "verify", "x", "--accepted", "x", "--revoked", "x"),
            2,
            "--revoked FILE goes with",
        ),
        ((*VERIFY[:-1], "pipe"), 1, "it is not a regular file"),
        ((*VERIFY[:-1], "huge"), 1, "more than the 1048576 allowed"),
        ((*VERIFY, "--revoked", "none"), 1, "no such file"),
        ((*VERIFY[:4], "timed.yaml", "--signers", "signers"), 1, "timed.yaml is not an acceptance"),
        ((*VERIFY[:4], "-", "--signers", "signers"), 1, "name the record by its file"),
    ],
)
def test_wrong_use_and_wrong_files(
    folder: Path, given: tuple[str, ...], code: int, words: str
) -> None:
    os.mkfifo("pipe")
    with Path("huge").open("wb") as file:
        file.truncate(1 << 40)
    done = fsn(*given)
    assert done.returncode == code, done.stderr
    assert words in done.stderr


def test_without_ssh_keygen_the_next_step_is_named(folder: Path) -> None:
    for given in (
        VERIFY,
        ("acceptance", "sign", RECORD, "--key", "anna", "--as", "author", "--overwrite"),
    ):
        done = fsn(*given, env={"PATH": str(folder)})
        assert done.returncode == 3
        assert "ssh-keygen is not installed" in done.stderr
        assert "apt install openssh-client" in done.stderr


def test_a_signature_is_one_of_openssh(folder: Path) -> None:
    check = ("ssh-keygen", "-Y", "verify", "-f", "signers", "-n", "fsoe-net-acceptance")
    with Path(RECORD).open("rb") as record:
        given = [*check, "-I", ANNA, "-s", f"{RECORD}.author.sig"]
        done = subprocess.run(given, stdin=record, capture_output=True, check=True)
    assert f"for {ANNA}".encode() in done.stdout
