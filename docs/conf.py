"""Configuration of the manual: ``make docs`` builds it, without a network."""

from __future__ import annotations

import sys
from importlib.metadata import version as version_of
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sphinx.application import Sphinx

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE / "_ext")]

import commands  # noqa: E402 (of _ext)
import effects_pages  # noqa: E402
import results  # noqa: E402

project = "pendmap"
author = "the pendmap authors"
release = version_of("pendmap")
version = release

extensions = [
    "mathml",
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_design",
    "sphinxcontrib.bibtex",
]
exclude_patterns = ["_build", "_ext", "**/.ipynb_checkpoints"]
nitpicky = True
# References to types of other packages, and the words of numpydoc for shapes: no page of ours.
# `Run` and `Experiment` of records and of the virtual rig have the same short names.
suppress_warnings = ["ref.python"]
nitpick_ignore_regex = [("py:.*", r"(?!pendmap\.).*")]

html_theme = "furo"
html_title = f"pendmap {release}"
html_math_renderer = "mathml"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_copyright = False
html_show_sphinx = False

myst_enable_extensions = ["colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 4
myst_dmath_allow_space = False
myst_dmath_allow_digits = False
myst_update_mathjax = False
nb_execution_mode = "off"
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = False
napoleon_use_rtype = False

bibtex_bibfiles = ["references.bib"]
bibtex_default_style = "plain"


def setup(_: Sphinx) -> dict[str, Any]:
    """Write the generated pages before they are read."""
    commands.write()
    results.write()
    effects_pages.write()
    return {"parallel_read_safe": True}
