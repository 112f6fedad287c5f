"""CI runs every script, at least in its shortest form."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
SCRIPTS = {
    path.name: path
    for folder in ("scripts", "scripts/rig")
    for path in (ROOT / folder).iterdir()
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
    texts = [(ROOT / name).read_text("utf-8") for name in STARTERS]
    texts.append((ROOT / "tests/master/test_standby_model.py").read_text("utf-8"))
    left |= set().union(*map(started_by, texts))
    while left:
        name = left.pop()
        seen.add(name)
        left |= started_by(SCRIPTS[name].read_text("utf-8")) - seen
    assert seen == SCRIPTS.keys()
