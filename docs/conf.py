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


def write_commands(app: object) -> None:
    """Write reference/commands.md: the help of each command."""
    import click

    from fsoe_net.cli.main import GROUPS, cli

    def text_of(command: click.Command, words: str, parent: click.Context | None) -> str:
        context = click.Context(command, info_name=words, parent=parent, max_content_width=100)
        parts = [f"```text\n{command.get_help(context)}\n```\n"]
        if isinstance(command, click.Group):
            for name in command.list_commands(context):
                part = command.get_command(context, name)
                parts.append(f"### {words} {name}\n\n{text_of(part, name, context)}")
        return "\n".join(parts)

    root = click.Context(cli, info_name="fsoe-net", terminal_width=100)
    parts = [
        "# Commands\n\nAs `--help` prints them. [The command line](cli.md) has what all share.\n"
    ]
    for title, commands in GROUPS.items():
        parts.append(f"**{title}:** " + ", ".join(f"[{name}](#{name})" for name in commands) + "\n")
    for name in cli.list_commands(root):
        parts.append(f"## {name}\n\n{text_of(cli.get_command(root, name), name, root)}")
    text = "\n".join(parts)
    page = Path(__file__).parent / "reference" / "commands.md"
    if not page.is_file() or page.read_text("utf-8") != text:
        page.write_text(text, "utf-8")


def setup(app: object) -> None:
    """Sphinx calls it before it looks for pages."""
    app.connect("builder-inited", write_commands)
