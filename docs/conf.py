"""Configuration of the manual: ``sphinx-build -W docs docs/_build`` in the root of the repository.

Nothing is fetched, neither when the manual is built nor when it is read: no inventories of other
projects, no fonts, no scripts of others. Formulas become MathML (`manual_extension`).
"""

import os
import sys
import tomllib
from pathlib import Path

_HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(_HERE), str(_HERE.parent)]
# kernels stay plain Python functions: documentation is no reason to compile
os.environ.setdefault("NUMBA_DISABLE_JIT", "1")

from inscal import __version__  # noqa: E402 - after the path above

_project = tomllib.loads((_HERE.parent / "pyproject.toml").read_text())["project"]
project = _project["name"]
release = version = __version__
language = "en"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "manual_extension",
]
exclude_patterns = ["_build", "_templates"]
templates_path = ["_templates"]

myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]  # as git hosts write formulas
myst_heading_anchors = 3

autosummary_generate = True
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings have types, shapes and units
autodoc_class_signature = "separated"
napoleon_google_docstring = False
napoleon_use_ivar = True
default_role = "py:obj"
add_module_names = False
toc_object_entries_show_parents = "hide"

html_theme = "furo"
html_title = f"{project} {release}"
html_math_renderer = "mathml"
html_static_path = ["_static"]
html_css_files = ["manual.css"]
html_copy_source = False
html_show_copyright = False
