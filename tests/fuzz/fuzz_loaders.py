"""Atheris targets: ``python tests/fuzz/fuzz_loaders.py TARGET [CORPUS… FILE… -libfuzzer_options]``.

``TARGET --seed-corpus DIR`` writes good inputs. Needs
``pip install -e '.[fuzz]'``; without it tests/fuzz/test_bodies.py runs the same bodies.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]


def _bodies(atheris: Any) -> dict[str, Any]:
    """Import the bodies, and what they fuzz with counters for its branches."""
    if atheris is None:
        from fuzz.bodies import TARGETS

        return TARGETS
    # Atheris cannot count in what the finder of an editable install loads; the plain one, which is
    # a class like all of Python's own, comes first then.
    sys.meta_path.sort(key=lambda finder: not isinstance(finder, type))
    with atheris.instrument_imports(include=["fsoe_net"], enable_loader_override=False):
        from fuzz.bodies import TARGETS
    return TARGETS


def _fuzz(arguments: list[str], name: str) -> None:
    try:
        import atheris
    except ImportError:
        sys.exit("atheris is not here; pip install -e '.[fuzz]'")
    target = _bodies(atheris)[name]
    with tempfile.TemporaryDirectory() as folder:
        target.prepare(Path(folder))
        atheris.Setup(arguments, lambda data: target.run(data, Path(folder)))
        atheris.Fuzz()


def main(argv: list[str]) -> None:
    name, options = "".join(argv[1:2]), argv[2:]
    if name.startswith("-") or not name or options[:1] == ["--seed-corpus"]:
        targets = _bodies(None)
        if name not in targets:
            sys.exit(f"usage: {argv[0]} TARGET …; targets are: {', '.join(targets)}")
        for number, seed in enumerate(targets[name].seeds()):
            Path(options[1], f"seed-{number}").write_bytes(seed)
        return
    _fuzz([argv[0], *options], name)


if __name__ == "__main__":
    main(sys.argv)
