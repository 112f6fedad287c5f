"""SII, the EEPROM image of a SubDevice."""

from __future__ import annotations

from fsoe_net.formats.registry import Format, Yields
from fsoe_net.formats.sii.hex_text import HEX_TEXT

FORMAT = Format(
    kind="sii",
    title="an SII image",
    expects="a binary EEPROM image, or one as Intel HEX or dump",
    yields=Yields.TYPES,
    read="fsoe_net.formats.sii.read:load_sii",
    guesses=HEX_TEXT,
    suffixes=(".sii", ".bin"),
    is_binary=True,
)
