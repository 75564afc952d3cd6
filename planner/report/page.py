"""Templates of the pages, and what makes JSON safe inside one."""

from pathlib import Path

import jinja2

FOLDER = Path(__file__).parent / "templates"


def load_template(name: str) -> jinja2.Template:
    """Return a page's template, ``name`` relative to this folder."""
    loader = jinja2.FileSystemLoader(FOLDER)
    settings = jinja2.Environment(
        loader=loader, autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return settings.get_template(name)


def safe_json(json_text: str) -> str:
    """Make JSON safe inside a script element: a name from a file cannot end it."""
    return json_text.replace("<", "\\u003c")
