"""Captures (pcap, pcapng) of a start-up: the bus that a MainDevice configured."""

from __future__ import annotations

from fsoe_net.formats.registry import Format, Signature, Yields

FORMAT = Format(
    kind="capture",
    title="a packet capture of a start-up (pcap, pcapng)",
    expects="the first bytes of a pcap or pcapng file, packed with gzip or not",
    yields=Yields.BUS,
    is_streamed=True,
    read="fsoe_net.capture.start_up:load_capture",
    signatures=(
        Signature(words="a packet capture (pcapng)", begins=rb"\x0a\x0d\x0d\x0a"),
        Signature(
            words="a packet capture (pcap)",
            begins=rb"\xd4\xc3\xb2\xa1|\xa1\xb2\xc3\xd4|\x4d\x3c\xb2\xa1|\xa1\xb2\x3c\x4d",
        ),
        Signature(
            words="a packet capture, packed with gzip",
            begins=rb"\x1f\x8b",
            confirm="fsoe_net.formats.capture.packets:is_capture",
        ),
    ),
)
