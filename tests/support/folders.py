"""Where tests find files: the project, its data, stored references, README."""

import os
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "data"
REFERENCE = ROOT / "tests" / "reference"
# For scripts that import from here. The project comes first, because test folders have its packages' names.
PYTHONPATH = os.pathsep.join([str(ROOT), str(ROOT / "tests")])
BOUNDARY_ELEMENTS = REFERENCE / "boundary_elements"
README = (ROOT / "README.md").read_text()
_SNIPPET = re.compile(r"^```python\n(.*?)^```", re.M | re.S)
_PAGES = ROOT / "notebooks"
REFERENCE_PAGES = [_PAGES / "reference.md", *sorted((_PAGES / "reference").glob("*.md"))]
HOW_TRUE = (_PAGES / "how_true.md").read_text()
_TROUBLESHOOTING = (_PAGES / "troubleshooting.md").read_text()
SNIPPETS = [
    snippet
    for page in (README, REFERENCE_PAGES[0].read_text(), HOW_TRUE, _TROUBLESHOOTING)
    for snippet in _SNIPPET.findall(page)
]
START_SNIPPETS = _SNIPPET.findall((_PAGES / "start_here.md").read_text())
RECIPE = "\n".join(_SNIPPET.findall((ROOT / "CONTRIBUTING.md").read_text()))
