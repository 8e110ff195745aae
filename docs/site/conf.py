"""Sphinx's configuration of the site; build_site.py runs it."""

from sphinx.application import Sphinx

import o80

project = "o80"
version = release = o80.__version__
html_title = f"o80 {version}"
extensions = ["myst_parser", "sphinx_design"]
myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 5
smartquotes = False  # flags keep their dashes
highlight_language = "none"
python_maximum_signature_line_length = 80
toc_object_entries_show_parents = "hide"
html_theme = "furo"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = html_show_copyright = False
suppress_warnings = ["ref.python"]  # several classes have a Config


def setup(app: Sphinx) -> None:
    app.add_object_type("declaration", "declaration", objname="C++ declaration")
