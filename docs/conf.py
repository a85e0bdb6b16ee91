"""The documentation: Sphinx, from Markdown. Built by `./gonio.sh dev sphinx-build -W docs docs/_build/html`."""

import sys
from pathlib import Path

import gonio

sys.path.insert(0, str(Path(__file__).parent / "extensions"))

project = "gonio"
author = "The gonio authors"
copyright = f"2026, {author}"
release = gonio.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinxcontrib.bibtex", "public_names"]
exclude_patterns = ["_build"]
nitpicky = True
smartquotes = False  # they would turn the (..., 3) of shapes into other characters

myst_enable_extensions = ["colon_fence", "deflist"]
myst_heading_anchors = 3
bibtex_bibfiles = ["bibliography.bib"]
bibtex_default_style = "plain"

# Signatures say quantities by their names; shapes, units and ranges stand in the text.
autodoc_typehints = "none"
autodoc_member_order = "bysource"

html_theme = "furo"
html_title = f"gonio {release}"
html_copy_source = False
html_show_sphinx = False
