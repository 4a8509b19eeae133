"""Build the documentation: `sphinx-build -W --keep-going -b html docs build/docs`."""

from __future__ import annotations

from importlib.metadata import version as installed
from typing import Any

from pydantic import BaseModel
from sphinx.util.docutils import SphinxDirective
from sphinx.util.inspect import TypeAliasForwardRef

from pushplan.logging.signals import SIGNALS
from pushplan.plans.execution import Execution

project = "pushplan"
author = "the pushplan authors"
copyright = f"2026, {author}; Apache License 2.0"
version = release = installed("pushplan")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx.ext.mathjax",
    "sphinx_copybutton",
]
templates_path = ["_templates"]
html_static_path = ["_static"]
html_css_files = ["site.css"]
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
nb_execution_mode = "force"  # notebooks are kept without output
nb_execution_in_temp = True
nb_execution_timeout = 600  # compiling, on a machine that has never run any of it
nb_execution_raise_on_error = True
nb_merge_streams = True
exclude_patterns = ["_build", "**.ipynb_checkpoints"]
default_role = "code"  # docstrings put code between single backticks
nitpicky = False

autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_type_aliases = {name: name for name in ("FloatArray", "IntArray", "BoolArray", "ArrayLike")}
python_maximum_signature_line_length = 88
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "show-inheritance": True, "exclude-members": "model_config"}
napoleon_use_rtype = False
napoleon_attr_annotations = False  # the signature tells the types
napoleon_use_ivar = True  # attributes are told in the docstring of their class, once

html_theme = "furo"
html_title = f"pushplan {version}"


TypeAliasForwardRef.__repr__ = lambda self: str(
    self.name
)  # in unions Sphinx 9 writes how it keeps an alias, not the alias


def setup(app: Any) -> None:
    """Keep napoleon from taking the first words of a property for its type where a colon follows them.

    Models of files have signatures of names and defaults: what pydantic knows of their types fills a page.
    """
    app.connect("autodoc-process-docstring", _begin_with_comment, priority=400)  # before napoleon
    app.connect("autodoc-process-signature", _without_types)
    app.add_directive("signals", SignalTable)


class SignalTable(SphinxDirective):
    """The recorded series, as `pushplan.logging.signals` declares them."""

    def run(self) -> list[Any]:
        """Return the table."""
        rows = ["| record | series | what | shape | unit | columns in CSV | topic |", "|---" * 7 + "|"]
        for kind, table in SIGNALS.items():
            for one in table.values():
                shape = ", ".join(map(str, one.shape("m", "n")))
                where = {"plate": "", "object": "O.", "contact": "C."}[one.of]
                columns = ", ".join(f"`{where}{column}`" for column in one.columns if kind is Execution)
                cells = (kind.__name__, f"`{one.name}`", one.quantity, f"({shape})", one.unit, columns, one.topic)
                rows.append("| " + " | ".join(cells) + " |")
        return self.parse_text_to_nodes("\n".join(rows))


def _begin_with_comment(_app: Any, what: str, _name: str, _obj: Any, _options: Any, lines: list[str]) -> None:
    if what in ("attribute", "property"):
        lines[:0] = ["..", ""]  # an empty comment


def _without_types(_app: Any, _what: str, _name: str, obj: Any, *_: Any) -> tuple[str, None] | None:
    if not (isinstance(obj, type) and issubclass(obj, BaseModel)):
        return None
    fields = obj.model_fields.items()
    return f"({', '.join(['*', *(f'{name}={field.default!r}' for name, field in fields)])})", None
