"""The C source of the compiled module: structs come whole from the headers."""

from __future__ import annotations

from pathlib import Path

import pytest

from fsoe_net.core.build_module import main

HEADER = """\
struct fsn_pair {
    unsigned first; /* counts; not
                       [values] */
    unsigned char text[FSN_LENGTH];
};
struct fsn_other {
    unsigned second;
};
"""


def _built(tmp_path: Path, cdef: str) -> str:
    (tmp_path / "fsn").mkdir()
    (tmp_path / "fsn" / "pair.h").write_text(HEADER)
    (tmp_path / "cdef.h").write_text(cdef)
    main(str(tmp_path / "cdef.h"), str(tmp_path), str(tmp_path / "out.c"))
    return (tmp_path / "out.c").read_text()


def test_a_struct_is_taken_from_the_header_and_the_compiler_has_its_lengths(
    tmp_path: Path,
) -> None:
    built = _built(tmp_path, "@struct fsn_pair\nint fsn_use(const struct fsn_pair *pair);\n")
    # An array whose length cffi leaves to the compiler is measured by sizeof.
    assert "offsetof(struct fsn_pair, text)" in built
    assert "sizeof(((struct fsn_pair *)0)->text)" in built
    assert "fsn_use" in built
    assert "fsn_other" not in built


def test_a_struct_that_no_header_has_is_named(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="struct fsn_none is in none of the headers"):
        _built(tmp_path, "@struct fsn_none\n")
