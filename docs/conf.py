"""How the documentation is built: ``./dev docs``, or Sphinx on this folder with -W."""

from __future__ import annotations

from thermoctl import __version__

project = "thermoctl"
author = "The thermoctl authors"
project_copyright = "the thermoctl authors"
version = release = __version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx.ext.viewcode",
    "numpydoc",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
root_doc = "index"
exclude_patterns = ["_build"]

myst_enable_extensions = ["amsmath", "deflist", "dollarmath"]
myst_heading_anchors = 4

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True, "undoc-members": False}
python_use_unqualified_type_names = True
numpydoc_show_class_members = False  # autodoc lists them already
numpydoc_xref_param_type = False

html_theme = "alabaster"
html_title = f"thermoctl {__version__}"
html_theme_options = {
    "description": "Holds a temperature, and says how sure it is of what it knows.",
    "fixed_sidebar": True,
    "page_width": "1100px",
}
html_show_sourcelink = False
