"""Sphinx configuration."""

import re
import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

project = "fsoe-net"
copyright = "the fsoe-net authors"  # noqa: A001
text = (Path(__file__).parents[1] / "fsoe_net" / "version.py").read_text("utf-8")
release = version = re.search(r'__version__ = "([^"]+)"', text).group(1)
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_copybutton"]
# Of a console only what a reader types; elsewhere the lines after a prompt, or everything.
copybutton_exclude = ".linenos, .gp, .go"
copybutton_prompt_text = "$ "
autodoc_typehints = "description"
default_role = "py:obj"
autodoc_member_order = "bysource"
napoleon_use_ivar = True
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
html_theme = "furo"
# Such as "0.1.0, unreleased", until its date is there.
news = (Path(__file__).parents[1] / "CHANGELOG.md").read_text("utf-8")
html_title = f"fsoe-net {re.search(r'^## (.*)$', news, re.MULTILINE).group(1)}"
templates_path = ["site/templates"]
html_static_path = ["site"]
html_css_files = ["site.css", "pictures.css"]
html_search_scorer = str(Path(__file__).parent / "site" / "scorer.js")
html_extra_path = ["extra"]
exclude_patterns = ["_build"]


def setup(app: Any) -> None:
    """Sphinx calls it before it looks for pages."""
    import generated

    here = Path(__file__).parent
    (here / "reference" / "commands.md").write_text(generated.commands(), "utf-8")
    (here / "site" / "pictures.css").write_text(generated.picture_style(), "utf-8")

    def fill_in(_app: Any, name: str, text: list[str]) -> None:
        text[0] = generated.fill_in(name, text[0])

    app.connect("source-read", fill_in)
