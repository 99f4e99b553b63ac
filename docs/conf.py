"""Configuration of the documentation site.

sphinx-build -W --keep-going docs docs/_build
"""

import os
import sys
import warnings
from pathlib import Path

from telepalpation import __version__

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))
sys.argv[0] = "sphinx-build"  # after python -m sphinx, cyclopts adds "-m sphinx" to each usage line
os.environ.setdefault("MPLBACKEND", "agg")
warnings.filterwarnings("ignore", message=".*is multi-threaded, use of fork", append=False)

project = "teleop"
author = "the contributors of teleop"
copyright = author  # noqa: A001
release = version = __version__

extensions = [
    "blocks",
    "estimator_figures",
    "mathml",
    "wide_blocks",
    "cyclopts.ext.sphinx",
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
]
exclude_patterns = ["_build", "_ext", "generated/gallery/*.ipynb", "generated/gallery/GALLERY*"]
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "attrs_inline"]
myst_heading_anchors = 4
html_math_renderer = "mathml"
nitpicky = False
smartquotes = False

autosummary_generate = True
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
autodoc_type_aliases = {name: name for name in ("ArrayLike", "Floats", "Samples")}
python_maximum_signature_line_length = 70
numpydoc_show_class_members = False

sphinx_gallery_conf = {
    "examples_dirs": "../examples",
    "gallery_dirs": "generated/gallery",
    "within_subsection_order": "FileNameSortKey",
    "filename_pattern": r"\.py$",
    "ignore_pattern": r"__init__\.py",
    "download_all_examples": False,
    "show_signature": False,
    "min_reported_time": 3600,
    "write_computation_times": False,
}

copybutton_prompt_text = r"\$ |>>> "
copybutton_prompt_is_regexp = True
copybutton_only_copy_prompt_lines = True
copybutton_exclude = ".linenos, .gp, .go"

html_theme = "pydata_sphinx_theme"
html_title = f"teleop {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_search_scorer = str(HERE / "_ext" / "search_scorer.js")
html_copy_source = False
html_show_sourcelink = False
html_theme_options = {
    "logo": {"text": "teleop"},
    "navbar_align": "left",
    "header_links_before_dropdown": 7,
    "secondary_sidebar_items": ["page-toc"],
    "show_prev_next": True,
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "footer_start": ["copyright"],
    "footer_end": ["theme-version"],
}
html_sidebars = {"index": []}
suppress_warnings = ["config.cache"]


def literal_bars(app, what, name, obj, options, lines):
    """Docstrings write |x| for an absolute value; reStructuredText would take it for a name."""
    lines[:] = [line.replace("|", "\\|") for line in lines]


def setup(app):
    """Register what the configuration itself defines."""
    app.connect("autodoc-process-docstring", literal_bars)
