"""Facts about a report as a document of a company: its number, its customer, a logo."""

from __future__ import annotations

from dataclasses import field

from fsoe_net.dataclass import dataclass
from fsoe_net.model.bus import Located


@dataclass(frozen=True, slots=True, kw_only=True)
class Logo:
    """A picture; ``media``: its type, such as ``image/png``."""

    media: str
    data: bytes = field(repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportFacts(Located):
    """Texts for the title block of a report, as written; empty if not stated.

    They are not part of the configuration: the fingerprint does not cover them.
    """

    number: str = ""
    revision: str = ""
    date: str = ""
    customer: str = ""
    logo: Logo | None = None
