"""Output of `slaveinfo -map` of SOEM."""

from __future__ import annotations

from fsoe_net.formats.registry import Format, Signature, Yields

_TITLE = "the output of SOEM `slaveinfo -map`"

FORMAT = Format(
    kind="soem",
    title=_TITLE,
    expects="lines such as `SM2 outputs` and `PDO mapping according to`",
    yields=Yields.BUS,
    read="fsoe_net.formats.soem.read:load_soem_text",
    signatures=(Signature(words=_TITLE, text=rb"SM\d+ (in|out)puts$|PDO mapping according to"),),
)
