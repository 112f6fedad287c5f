"""Output of the `ethercat` tool of IgH, and C headers for its library or any other."""

from __future__ import annotations

from fsoe_net.formats.registry import Format, Signature, Target, Yields

CSTRUCT = Signature(
    words="the output of `ethercat cstruct`", text=rb"\b(?:ec|fsn)_(?:pdo_entry|sync)_info_t\b"
)
_WRITE = "fsoe_net.formats.igh.write:write_c_header"
_STATES = rb"(INIT|PREOP|BOOT|SAFEOP|OP|\?\?\?)(\+ERROR)?"

FORMAT = Format(
    kind="ethercat",
    title="the output of the `ethercat` tool",
    expects="what ethercat pdos, cstruct, xml, slaves, sii_read -v, config -v or domains -v prints",
    yields=Yields.BUS,
    read="fsoe_net.formats.igh.read:load_igh_text",
    signatures=(
        Signature(
            words="the output of `ethercat xml`",
            root="EtherCATInfo",
            text=rb"<!-- Slave \d+ -->",
        ),
        Signature(
            words="the output of `ethercat xml` for several SubDevices", root="EtherCATInfoList"
        ),
        CSTRUCT,
        Signature(words="the output of `ethercat domains -v`", text=rb"^Domain\d+: LogBaseAddr"),
        Signature(words="the output of `ethercat sii_read -v`", text=rb"\bSII Area:[ \t]*\r?$"),
        Signature(words="the output of `ethercat pdos`", text=rb"SM\d+: PhysAddr 0x"),
        Signature(words="the output of `ethercat config -v`", text=rb"^Watchdog divider:"),
        Signature(words="the output of `ethercat slaves -v`", text=rb"^[ \t]+Vendor Id: +0x"),
        Signature(
            words="the output of `ethercat slaves`",
            text=rb"^[ \t]*\d{1,5} +\d{1,5}:\d{1,5} +" + _STATES + b" ",
        ),
    ),
    guesses=(b"<EtherCATInfo",),  # XML after a prompt
    targets=(
        Target(name="igh", write=_WRITE, options={"igh": True}, suffixes=(".h",)),
        Target(name="c", write=_WRITE, options={"igh": False}),
    ),
)
