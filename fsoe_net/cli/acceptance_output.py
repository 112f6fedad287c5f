"""Output of ``fsoe-net acceptance``, and its examples."""

from __future__ import annotations

from fsoe_net.acceptance.sign_off import Refusal
from fsoe_net.cli.terminal import echo, show
from fsoe_net.diag.words import counted
from fsoe_net.document.model import Document, Level, Part, Verdict, words
from fsoe_net.model.acceptance import Acceptance, CheckedSignature
from fsoe_net.plan.fingerprint import short_code
from fsoe_net.project.known import AcceptedRecord

EPILOG = """\b
Example:
  fsoe-net test-record network.yaml --virtual -o test-record.yaml    # then do it at the machine
  fsoe-net report network.yaml --test-record test-record.yaml -o report.html
  fsoe-net report network.yaml --test-record test-record.yaml -o report.json
  fsoe-net acceptance record network.yaml --test-record test-record.yaml \\
      --report report.html --report report.json \\
      --author "A. Meier" --author-competence "maker of the cell" \\
      --verifier "B. Kaya" --verifier-competence "functional safety engineer" \\
      --equipment "oscilloscope 4711" --environment "hall 3" -o acceptance.yaml \\
      --justify "FSN607@network.yaml:43=both sheets were read, copies in folder 7 by B. Kaya" \\
      --justify "loss io_box=soldered in, cannot be unplugged by B. Kaya"

\b
Afterwards:
  fsoe-net acceptance verify network.yaml --accepted acceptance.yaml     # or --socket PATH
  fsoe-net report network.yaml --accepted acceptance.yaml -o signed.html # what has changed

\b
Signatures, each by the key of that person; names then are "NAME <PRINCIPAL>":
  fsoe-net acceptance sign acceptance.yaml --key ~/.ssh/id_ed25519 --as author
  fsoe-net acceptance sign acceptance.yaml --key ~/.ssh/id_ed25519 --as verifier

Exit codes: 0 written, 1 refused with every reason, or a file cannot be used, 2 usage error, 3 no
ssh-keygen, or no disk.

A record is evidence, not a certificate. A signature shows who agreed, not that it is right."""


def print_refusals(refusals: tuple[Refusal, ...]) -> None:
    """Print why there is no record."""
    parts: list[Part] = []
    for refusal in refusals:
        parts.append(words(Verdict("refused: ", Level.ERROR), refusal.what))
        parts.append(words(f"  next: {refusal.fix}"))
    parts.append(words(f"no record written: {counted(len(refusals), 'reason')}"))
    show(Document(lead=tuple(parts)), err=True)


def print_record(output: str, record: Acceptance, before: AcceptedRecord | None) -> None:
    """Print what was written, and the next step."""
    echo(
        f"{output}: {short_code(record.whole)}, author {record.author.name}, verifier "
        f"{record.verifier.name}, {record.verifier.date}"
    )
    findings, steps = len(record.findings), len(record.steps_left_out)
    if findings or steps:
        echo(
            f"let pass: {counted(findings, 'warning')}, {counted(steps, 'other')}, each by name "
            "and reason"
        )
    if before is not None:
        same = before.fingerprint.whole == record.whole
        word = "the same configuration as" if same else "replaces"
        echo(f"{word} {before.source.path}, {before.fingerprint.short}")
    echo(f"Sign the report, and `fsoe-net acceptance sign {output}`; keep both in version control.")


def print_signature(signature: CheckedSignature) -> None:
    """Print who signed, with which key."""
    echo(f"signed as {signature.role} by {signature.principal}, {signature.key}")
