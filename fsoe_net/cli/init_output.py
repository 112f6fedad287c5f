"""The files that ``fsoe-net init`` writes, and its summary of them."""

from __future__ import annotations

from pathlib import Path

from fsoe_net.cli.output import print_diagnostics
from fsoe_net.cli.terminal import echo
from fsoe_net.diag.diagnostic import Severity, sort_diagnostics
from fsoe_net.diag.words import counted, summary
from fsoe_net.project.check import check_files
from fsoe_net.proposal.draft import Draft


def write_network(made: Draft, folder: Path, *, overwrite: bool) -> bool:
    """Write the network and check it; return whether it has an error."""
    assert made.proposal is not None  # noqa: S101 - no question about the ring is open
    shown = [
        d
        for d in (*made.inputs.found.out.diagnostics, *made.findings)
        if d.level is not Severity.INFO
    ]
    print_diagnostics(sort_diagnostics(shown), err=True)
    written = made.files()
    description = made.proposal.bus
    made.save(folder, overwrite=overwrite)
    for note in dict.fromkeys((*made.notes, *written.notes)):
        echo(f"note: {note}", err=True)
    network = folder / "network.yaml"
    rows = description.connections
    unconfirmed = sum(bool(r.unconfirmed) for r in rows)
    echo(
        f"{network}: {counted(len(description.subdevices), 'SubDevice')}, "
        f"{counted(len(rows), 'FSoE connection')}, {unconfirmed} of them unconfirmed, "
        f"{counted(len(written.files), 'file')}"
    )
    # Checked as the user will check it: the written files must be readable.
    checked = check_files([str(network)])
    left = [d for d in checked.diagnostics if d.level is not Severity.INFO]
    print_diagnostics(left)
    if made.open:
        echo("\nOpen:")
    for text in made.open:
        echo(f"  - {text}")
    errors = sum(d.level is Severity.ERROR for d in left)
    echo(
        f"\nNext: {'complete' if errors or made.open else 'read'} {network}, "
        f"then fsoe-net check {network}" + (f"   ({summary(left)} now)" if left else "")
    )
    return errors > 0
