"""Sphinx: the pages are Markdown, their code blocks are executed, the reference is made from the docstrings.

Build with:  sphinx-build -W --keep-going -b html docs docs/_build/html
"""

import os
import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE / "_ext"), str(HERE.parent)]

from benchmarks.quoted import quotable  # noqa: E402
from sand_gallery import configuration  # noqa: E402

from sand import __version__  # noqa: E402

project = "SAND"
author = "The SAND developers"
copyright = "The SAND developers, BSD 3-clause licence"
version = release = __version__

extensions = [
    "myst_nb",
    "sphinx_gallery.gen_gallery",
    "sphinx.ext.autodoc",
    "numpydoc",
    "sphinx_click",
    "sphinx.ext.mathjax",
    "sphinx-mathjax-offline",
    "sand_docs",
    "validation",
    "offline",
    "searched",
]
source_suffix = {".md": "myst-nb", ".rst": "restructuredtext"}
exclude_patterns = ["_build", "_ext", "**.ipynb_checkpoints", "gallery/**.ipynb"]
nitpicky = True
# aliases of types of other packages, whose pages would be needed to link them
nitpick_ignore_regex = [("py:class", r"(collections|numpy|pathlib|typing)\..*")]

# Docstrings name types, shapes and units in words, so annotations stay out of the signatures.
autodoc_typehints = "none"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
autodoc_preserve_defaults = True
# autodoc lists the members
numpydoc_show_class_members = False
# `code` in docstrings
default_role = "code"
# values such as "200 A m^2/kg" are for copying
smartquotes = False

myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence", "deflist", "substitution"]
# figures of cost, of docs/measured.json
myst_substitutions = quotable()
myst_heading_anchors = 3
myst_dmath_double_inline = True

# Every page with code runs anew at every build: a page can only show what this version does.
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 300
nb_execution_in_temp = True
nb_execution_show_tb = True
nb_merge_streams = True
nb_render_markdown_format = "myst"
# pages call the `sand` command of this very environment, and copy the examples of this checkout
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
os.environ["SAND_EXAMPLES"] = str(HERE.parent / "examples")

sphinx_gallery_conf = configuration(HERE, HERE.parent / "examples" / "gallery")

html_theme = "furo"
html_title = f"SAND {release}"
html_show_sphinx = False
html_theme_options = {"navigation_with_keys": True}
html_static_path = ["_static"]
html_css_files = ["sand.css"]
