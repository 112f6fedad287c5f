"""Every network of the broken examples gets a report that names each of its errors on top."""

from __future__ import annotations

import pytest
from cli.tool import fsn
from networks import EXAMPLES


@pytest.mark.parametrize("path", sorted((EXAMPLES / "broken").glob("*.yaml")), ids=lambda p: p.stem)
def test_report_of_a_broken_example_names_its_errors(path, tmp_path):
    out = tmp_path / "r.html"
    done = fsn("report", str(path), "-o", str(out))
    first = out.read_text("utf-8").partition("</header>")[0]
    codes = {w.partition("]")[0] for w in done.stderr.split("error[")[1:]}
    assert done.returncode == int(bool(codes)), done.stderr
    assert ("NOT ACCEPTABLE" in first) is bool(codes)
    assert all(code in first for code in codes)
