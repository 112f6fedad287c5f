"""A folder with a network that two persons accepted and signed, with keys of its own."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import yaml
from cli.tool import fsn

BASE = Path(__file__).parents[1] / "diagnostics" / "base"
ANNA, BERT = "a.meier@example.org", "b.kaya@example.org"
RECORD = "acceptance.yaml"
DAY = "2021-11-21"


def make_signed(folder: Path) -> Path:
    """Go the whole way from a network to two signatures by `fsoe-net acceptance record`."""
    shutil.copy(BASE / "timed.yaml", folder)
    shutil.copytree(BASE / "devices", folder / "devices")
    for name in ("anna", "bert", "carl"):
        made = ["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-C", name, "-f", folder / name]
        subprocess.run(made, check=True)
    lines = (f"{who} {public_key(folder, key)}" for who, key in ((ANNA, "anna"), (BERT, "bert")))
    (folder / "signers").write_text("".join(lines), "utf-8")

    def done(*given: str) -> None:
        found = fsn(*given, cwd=folder)
        assert found.returncode == 0, found.stderr

    done("test-record", "timed.yaml", "-o", "test-record.yaml")
    fill_in(folder / "test-record.yaml", DAY)
    (folder / "photos").mkdir()
    (folder / "photos" / "panel.jpg").write_bytes(b"a photo of the panel")
    for form in ("html", "json"):
        done("report", "timed.yaml", "--test-record", "test-record.yaml", "-o", f"report.{form}")
    done(
        *(
            "acceptance",
            "record",
            "timed.yaml",
            "--test-record",
            "test-record.yaml",
            "-o",
            RECORD,
            "--date",
            DAY,
        ),
        *("--report", "report.html", "--report", "report.json"),
        *("--author", f"A. Meier <{ANNA}>", "--verifier", f"B. Kaya <{BERT}>"),
        *("--author-competence", "maker of the cell", "--verifier-competence", "safety engineer"),
        *("--justify", "loss *=soldered in by B. Kaya"),
        *("--justify", "bus evidence=no access by B. Kaya"),
        *(
            "--equipment",
            "oscilloscope 4711, calibrated until 2022-03",
            "--equipment",
            "stop watch",
        ),
        *("--environment", "hall 3, 21 degrees", "--attach", "photos/panel.jpg"),
    )
    done("acceptance", "sign", RECORD, "--key", "anna", "--as", "author")
    done("acceptance", "sign", RECORD, "--key", "bert", "--as", "verifier")
    return folder


def fill_in(path: Path, day: str = "", *, loss: bool = False) -> None:
    """Write results into a test record, as a person does at the machine."""
    document = yaml.safe_load(path.read_text("utf-8"))
    document["made"] = day or document["made"]
    for device in document["devices"]:
        device.update(dict.fromkeys(device.keys() - {"subdevice"}, "not applicable: emulated"))
    for step in document["steps"]:
        if step["kind"] in ("start_up", "trigger", *(("loss",) if loss else ())):
            done = {"result": "as expected", "measured_ms": 60, "remark": ""}
            step["machine"] = {**done, "by": "A. Meier", "date": document["made"]}
    path.write_text(yaml.safe_dump(document), "utf-8")


def public_key(folder: Path, name: str) -> str:
    """Return type and key, as a line of a file of allowed signers ends."""
    return " ".join((folder / f"{name}.pub").read_text("utf-8").split()[:2]) + "\n"


def sign(folder: Path, key: str, role: str, namespace: str = "fsoe-net-acceptance") -> None:
    """Sign the record without fsoe-net, as somebody who means harm would."""
    command = ["ssh-keygen", "-q", "-Y", "sign", "-f", folder / key, "-n", namespace]
    with (folder / RECORD).open("rb") as record:
        done = subprocess.run(command, stdin=record, capture_output=True, check=True)
    (folder / f"{RECORD}.{role}.sig").write_bytes(done.stdout)
