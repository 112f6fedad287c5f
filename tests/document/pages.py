"""Documents with every kind of block."""

from __future__ import annotations

from fsoe_net.document.model import (
    Bullets,
    Column,
    Document,
    Heading,
    Level,
    Lines,
    Number,
    Picture,
    Section,
    Table,
    Verdict,
    cell,
    muted,
    words,
)

ALL = Document(
    title="title \x1b[31m",
    verdict=Verdict("not \u202eso", Level.ERROR),
    lead=(words("first ", muted("second\x07")), Bullets((cell("one two three four"),))),
    sections=(
        Section(
            key="s",
            title="Section",
            parts=(
                Heading("Heading"),
                Table(
                    columns=(
                        Column("name"),
                        Column("time", number=True),
                        Column("why", wraps=True),
                    ),
                    rows=(
                        (cell("a", "b"), cell(Number(value=1, text="1", unit="ms", source="s")),
                         cell("because it is so, and not otherwise, whatever anybody says")),
                        (cell("\x9b2J"), cell("12"), cell("")),
                    ),
                    remark="of the machine",
                ),
                Lines(("$ a command that stays on its line, however narrow the terminal is",)),
                Picture(title="picture", words="what it shows", svg="<svg/>", lines=("##.",)),
                Table(columns=(Column("name"),), rows=()),
            ),
        ),
    ),
)  # fmt: skip
