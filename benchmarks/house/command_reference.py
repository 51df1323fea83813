"""Write docs/reference/command-line.md from what `plan --help` says.

Usage: python -m benchmarks.house.command_reference [--check]
    --check: write nothing, exit 1 if the page isn't what it would be.
"""

import sys
from pathlib import Path

import click

from planning.cli.main import commands

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "command-line.md"
_HEAD = """# Command line

Made from `plan --help` by `python -m benchmarks.house.command_reference`.
"""


def reference() -> str:
    """Return the page."""
    parts = [_HEAD, _section("plan", commands, None)]
    parent = click.Context(commands, info_name="plan", **commands.context_settings)
    for name in commands.list_commands(parent):
        parts.append(_section(f"plan {name}", commands.commands[name], parent))
    return "\n".join(parts)


def _section(title: str, command: click.Command, parent: click.Context | None) -> str:
    settings = {"terminal_width": 96, "max_content_width": 96, "show_default": True}
    settings = command.context_settings | settings
    name = title.split()[-1]
    with click.Context(command, info_name=name, parent=parent, **settings) as context:
        return f"## `{title}`\n\n```\n{command.get_help(context)}\n```\n"


def main() -> int:
    """Write or check the page."""
    if "--check" in sys.argv[1:]:
        return int(PAGE.read_text(encoding="utf-8") != reference())
    PAGE.write_text(reference(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
