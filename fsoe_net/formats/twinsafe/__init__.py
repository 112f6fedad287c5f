"""Exports of TwinSAFE projects."""

from __future__ import annotations

from fsoe_net.formats.registry import Format, Signature, Yields

FORMAT = Format(
    kind="twinsafe",
    title="a TwinSAFE project export",
    expects="XML with the root <Project>, <SafetyDeviceDesc> or <safetyApplication>",
    yields=Yields.CONNECTIONS,
    read="fsoe_net.formats.twinsafe.read:load_twinsafe",
    signatures=(
        Signature(words="a TwinSAFE project export", root="Project"),
        Signature(words="a TwinSAFE alias device", root="SafetyDeviceDesc"),
        Signature(words="a TwinSAFE group", root="safetyApplication"),
    ),
    parts={".splcproj": (".sds", ".sal", ".sal.diagram", ".bak")},
)
