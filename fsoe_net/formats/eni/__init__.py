"""ENI (EtherCAT network information): reading, writing, and replacing its copies."""

from __future__ import annotations

from fsoe_net.formats.registry import Format, Signature, Target, Yields

FORMAT = Format(
    kind="eni",
    title="an ENI",
    expects="XML with the root <EtherCATConfig>",
    yields=Yields.BUS,
    read="fsoe_net.formats.eni.read:load_eni",
    signatures=(Signature(words="an ENI (EtherCAT network information)", root="EtherCATConfig"),),
    targets=(
        Target(
            name="eni",
            write="fsoe_net.formats.eni.write:write_eni_file",
            suffixes=(".eni.xml", ".eni"),
            renew="fsoe_net.formats.eni.write_copies:renewed_eni",
            needs_start=True,
        ),
    ),
)
