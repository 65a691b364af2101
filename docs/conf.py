"""Sphinx configuration: the site is built with warnings as errors (see CONTRIBUTING.md)."""

import sys
from importlib.metadata import version as installed_version
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from extensions.stated import stated

project = "seqopt"
author = "The seqopt developers"
copyright = "2026, the seqopt developers"
version = release = installed_version("seqopt")

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "numpydoc",
    "sphinx_copybutton",
    "extensions.equations",
    "extensions.docstrings",
    "extensions.downloads",
    "extensions.one_kernel",
    "extensions.pictures",
]
html_theme = "furo"
html_title = "seqopt"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_math_renderer = "mathml"
html_copy_source = False
html_use_index = html_domain_indices = False  # the search finds every name
exclude_patterns = ["_build", "jupyter_execute", "counterparts.md"]  # left behind; a part of a page
myst_enable_extensions = ["amsmath", "dollarmath", "deflist", "substitution"]
myst_substitutions = stated()  # figures of the stored runs, by name: {{ name }} in a page
myst_heading_anchors = 3

nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 120
nb_merge_streams = True
nb_output_stderr = "remove"  # how far a command is

nitpicky = True
nitpick_ignore_regex = [("py:class", r"(numpy|collections)\..*")]  # they have pages elsewhere

autodoc_member_order = "bysource"
autodoc_use_type_comments = False  # there are none, and the search for them takes long
autodoc_typehints = "none"  # the numpydoc sections carry shapes and units
numpydoc_show_class_members = False
