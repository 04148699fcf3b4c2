"""Configuration of the documentation site: `sphinx-build -W --keep-going notebooks build/site`."""

import sys
from pathlib import Path

import latex2mathml.converter
from docutils.nodes import SkipNode

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import rubberfric

project = "rubberfric"
version = release = rubberfric.__version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "numpydoc"]
exclude_patterns = ["README.md", "formats_introduction.md"]  # index.md and formats.md replace them
default_role = "code"  # `name` in docstrings

html_theme = "furo"
html_title = f"rubberfric {version}"
html_copy_source = False
html_show_sourcelink = False
html_show_copyright = False
html_static_path = ["static"]
html_css_files = ["site.css"]
html_math_renderer = "mathml"

nb_execution_mode = "off"  # the notebooks are stored with their outputs
myst_enable_extensions = ["deflist", "dollarmath"]
myst_heading_anchors = 3

autodoc_typehints = "none"  # the Parameters sections give the types
autodoc_default_options = {"members": True}
autodoc_member_order = "bysource"
numpydoc_show_class_members = False


def inline_formula(translator, node):
    """Write a formula as MathML, which browsers show without scripts or fonts from elsewhere."""
    translator.body.append(latex2mathml.converter.convert(node.astext()))
    raise SkipNode


def displayed_formula(translator, node):
    """Write a displayed formula."""
    translator.body.append(latex2mathml.converter.convert(node.astext(), display="block"))
    raise SkipNode


PAGES = {  # pages of the site that stand for files of the project
    "data/README.md": "data.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "rubberfric/theory/paper.py": "from_paper_to_code.md",
}


def link_to_pages(_app, *given):
    """Replace links to files of the project by links to pages of the site."""
    text = given[-1]  # a list of one string
    for path, page in PAGES.items():
        text[0] = text[0].replace(f"]({path})", f"](notebooks/{page})").replace(f"](../{path})", f"]({page})")


def skip_plain_fields(_app, _what, _name, member, _skip, _options):
    """Leave out fields of named tuples, whose automatic docstring is only their number."""
    return True if (getattr(member, "__doc__", None) or "").startswith("Alias for field number") else None


def setup(app):
    """Register the renderer of formulas, the change of links and the choice of members."""
    app.connect("autodoc-skip-member", skip_plain_fields)
    app.connect("source-read", link_to_pages)
    app.connect("include-read", link_to_pages)
    app.add_html_math_renderer("mathml", (inline_formula, None), (displayed_formula, None))
