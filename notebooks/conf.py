"""Configuration of the documentation site: `sphinx-build -W --keep-going notebooks build/site`."""

import re
import sys
from pathlib import Path

import latex2mathml.converter
import numpydoc.xref
from docutils import nodes
from docutils.nodes import SkipNode
from sphinx.transforms import SphinxTransform

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import rubberfric

project = "rubberfric"
version = release = rubberfric.__version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.viewcode", "numpydoc"]
exclude_patterns = ["README.md", "formats_introduction.md"]  # index.md and formats.md replace them
default_role = "code"  # `name` in docstrings

html_theme = "furo"
html_title = f"rubberfric {version}"
html_copy_source = False
html_show_sourcelink = False
html_show_copyright = False
html_static_path = ["static"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_math_renderer = "mathml"

nb_execution_mode = "off"  # the notebooks are stored with their outputs
myst_enable_extensions = ["deflist", "dollarmath"]
myst_heading_anchors = 3

autodoc_typehints = "none"  # the Parameters sections give the types
autodoc_default_options = {"members": True}
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
# Types of parameters link to the classes of the reference.
numpydoc_xref_param_type = True
numpydoc_xref_ignore = "all"
numpydoc.xref.DEFAULT_LINKS.clear()  # links to other sites
numpydoc_xref_aliases = {
    name.rsplit(".", 1)[1]: name
    for page in sorted((Path(__file__).parent / "reference").glob("*.md"))
    for name in re.findall(r"^\.\. autoclass:: ([\w.]+)$", page.read_text(), re.M)
}


def inline_formula(translator, node):
    """Write a formula as MathML, which browsers show without scripts or fonts from elsewhere."""
    translator.body.append(latex2mathml.converter.convert(node.astext()))
    raise SkipNode


def displayed_formula(translator, node):
    """Write a displayed formula."""
    translator.body.append(latex2mathml.converter.convert(node.astext(), display="block"))
    raise SkipNode


class Primes(SphinxTransform):
    """Write E' and E'' with primes. Sphinx makes quotation marks of apostrophes."""

    default_priority = 740  # before the quotation marks, at 750

    def apply(self):
        """Replace apostrophes behind a symbol in all texts except code."""
        for text in list(self.document.findall(nodes.Text)):
            if isinstance(text.parent, nodes.literal | nodes.literal_block | nodes.math | nodes.math_block):
                continue
            new = re.sub(r"(?<![A-Za-z0-9])([A-Z]|a_T)('{1,2})(?![A-Za-z'])", _primed, text.astext())
            if new != text.astext():
                text.parent.replace(text, nodes.Text(new))


def _primed(match):
    return match[1] + "\u2032\u2033"[len(match[2]) - 1]


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
    app.add_transform(Primes)
    app.connect("autodoc-skip-member", skip_plain_fields)
    app.connect("source-read", link_to_pages)
    app.connect("include-read", link_to_pages)
    app.add_html_math_renderer("mathml", (inline_formula, None), (displayed_formula, None))
