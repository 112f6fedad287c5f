"""XML of linuxcnc-ethercat, read and written."""

from __future__ import annotations

from fsoe_net.formats.registry import Format, Signature, Target, Yields

FORMAT = Format(
    kind="lcec",
    title="a configuration of linuxcnc-ethercat",
    expects="XML with the root <masters>",
    yields=Yields.BUS,
    read="fsoe_net.formats.lcec.read:load_lcec",
    has_masters=True,
    signatures=(Signature(words="a configuration of linuxcnc-ethercat", root="masters"),),
    targets=(
        Target(name="lcec", write="fsoe_net.formats.lcec.write:write_lcec", suffixes=(".xml",)),
    ),
)
