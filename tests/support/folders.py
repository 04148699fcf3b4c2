"""Where tests find files: the project, its data, stored references, README."""

import os
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "data"
# Scenes of the data. Jobs of fits end in _fit.
SCENE_FILES = sorted(path for path in DATA.glob("*.toml") if not path.stem.endswith("_fit"))
REFERENCE = ROOT / "tests" / "reference"
# For scripts that import from here. The project comes first, because test folders have its packages' names.
PYTHONPATH = os.pathsep.join([str(ROOT), str(ROOT / "tests")])
BOUNDARY_ELEMENTS = REFERENCE / "boundary_elements"
README = (ROOT / "README.md").read_text()
_SNIPPET = re.compile(r"^```python\n(.*?)^```", re.M | re.S)
_PAGES = ROOT / "notebooks"
REFERENCE_PAGES = [_PAGES / "reference.md", *sorted((_PAGES / "reference").glob("*.md"))]
REFERENCE_NAMES = [
    name
    for page in REFERENCE_PAGES
    for name in re.findall(r"^\.\. auto\w+:: ([\w.]+)$", page.read_text(), re.M)
]
# The snippets of the reference continue those of README.
SNIPPETS = [
    snippet for page in (README, REFERENCE_PAGES[0].read_text()) for snippet in _SNIPPET.findall(page)
]
# Pages whose snippets need no other page.
PAGE_SNIPPETS = {
    name: _SNIPPET.findall((_PAGES / f"{name}.md").read_text())
    for name in ("how_true", "options", "start_here", "troubleshooting")
}
RECIPE = "\n".join(_SNIPPET.findall((ROOT / "CONTRIBUTING.md").read_text()))
