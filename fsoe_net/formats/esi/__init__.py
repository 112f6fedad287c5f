"""ESI, EtherCAT SubDevice information: the device description of a vendor."""

from __future__ import annotations

from fsoe_net.formats.registry import Format, Signature, Yields

FORMAT = Format(
    kind="esi",
    title="an ESI",
    expects="XML with the root <EtherCATInfo>",
    yields=Yields.CATALOGUE,
    read="fsoe_net.formats.esi.read:load_esi",
    signatures=(
        Signature(
            words="an ESI (EtherCAT SubDevice information, or `ethercat xml` of one SubDevice)",
            root="EtherCATInfo",
        ),
        Signature(words="an ESI module file", root="EtherCATModule"),
        Signature(words="an ESI dictionary file", root="EtherCATDict"),
    ),
    suffixes=(".esi.xml",),
)
