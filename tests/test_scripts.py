"""CI runs every script, at least in its shortest form."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
SCRIPTS = {
    path.name: path
    for pattern in ("scripts/*", "scripts/rig/*", "packaging/build-*")
    for path in ROOT.glob(pattern)
    if path.is_file() and not path.suffix
}


STARTERS = (".ci/run", "Makefile", ".github/workflows/release.yml", ".github/workflows/docs.yml")


def started_by(text: str) -> set[str]:
    """Return the scripts whose name a text has, other than in a comment."""
    code = re.sub(r"(?m)^\s*#.*$", "", text)
    return SCRIPTS.keys() & set(re.findall(r"[\w-]+", code))


def test_ci_runs_every_script():
    seen: set[str] = set()
    left = {"test"}
    left |= set().union(*(started_by((ROOT / name).read_text("utf-8")) for name in STARTERS))
    while left:
        name = left.pop()
        seen.add(name)
        left |= started_by(SCRIPTS[name].read_text("utf-8")) - seen
    assert seen == SCRIPTS.keys()
