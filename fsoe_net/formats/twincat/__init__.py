"""TwinCAT projects."""

from __future__ import annotations

from fsoe_net.formats.registry import Format, Signature, Yields

FORMAT = Format(
    kind="twincat",
    title="a TwinCAT project",
    expects="XML with the root <TcSmProject> or <TcSmItem>",
    yields=Yields.BUS,
    read="fsoe_net.formats.twincat.read:load_twincat",
    has_masters=True,
    signatures=(
        Signature(words="a TwinCAT project", root="TcSmProject"),
        Signature(words="a TwinCAT project part", root="TcSmItem"),
    ),
    parts={
        ".tsproj": (
            *(".xti", ".splcproj", ".sds", ".sal", ".sal.diagram", ".bak", ".plcproj", ".tmc"),
            *(".tcpou", ".tcgvl", ".tcdut", ".tcvis", ".tcvmo", ".tctto", ".tcio"),
            *("targetsystemconfig.xml", "targetdescription.xml"),
        ),
    },
)
