"""Puts a mutant in the place of one module, in each Python that a test starts.

`FSN_MUTANT` is the module's name, its path and the path of the mutant's text, as
JSON; the server puts the same finder into its own forks.
"""

from __future__ import annotations

import json
import os
import sys
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec


class MutantFinder(MetaPathFinder, Loader):
    """Finds one module, whose text comes from another file."""

    def __init__(self, module: str, path: str, text: str) -> None:
        self._module, self._path, self._text = module, path, text

    def find_spec(self, fullname, path=None, target=None):
        """Return how the module is loaded, None for all others."""
        if fullname != self._module:
            return None
        spec = ModuleSpec(fullname, self, origin=self._path)
        spec.has_location = True
        if os.path.basename(self._path) == "__init__.py":
            spec.submodule_search_locations = [os.path.dirname(self._path)]
        return spec

    def exec_module(self, module):
        """Run the mutant; tracebacks name the file it was made of."""
        with open(self._text, encoding="utf-8") as file:
            exec(compile(file.read(), self._path, "exec"), module.__dict__)


def install() -> None:
    """Put the finder first where the environment names a mutant."""
    told = os.environ.get("FSN_MUTANT")
    if told:
        sys.meta_path.insert(0, MutantFinder(*json.loads(told)))


install()
