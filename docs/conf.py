"""Sphinx configuration."""

import re
from pathlib import Path

project = "fsoe-net"
copyright = "the fsoe-net authors"  # noqa: A001
text = (Path(__file__).parents[1] / "fsoe_net" / "version.py").read_text("utf-8")
release = version = re.search(r'__version__ = "([^"]+)"', text).group(1)
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
autodoc_typehints = "description"
default_role = "py:obj"
autodoc_member_order = "bysource"
napoleon_use_ivar = True
myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = f"fsoe-net {release}"
exclude_patterns = ["_build"]
