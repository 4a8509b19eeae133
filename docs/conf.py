"""Build the documentation: `sphinx-build -W --keep-going -b html docs build/docs`."""

from __future__ import annotations

from importlib.metadata import version as installed

project = "pushplan"
author = "the pushplan authors"
version = release = installed("pushplan")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.mathjax"]
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]
default_role = "code"  # docstrings put code between single backticks
nitpicky = False

autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "show-inheritance": True}
napoleon_use_rtype = False
napoleon_use_ivar = True  # attributes are told in the docstring of their class, once

html_theme = "furo"
html_title = "pushplan"
