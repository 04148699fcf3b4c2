"""Where tests find files: the project, its data, stored references, measurements not its own, README."""

import os
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "data"
REFERENCE = ROOT / "tests" / "reference"
# Of programs that import from here. The project stands first: folders of tests have its packages' names.
PYTHONPATH = os.pathsep.join([str(ROOT), str(ROOT / "tests")])
TYRE = ROOT.parent / "shared" / "data" / "tyre"
PUBLIC = ROOT.parent / "shared" / "data" / "public"
README = (ROOT / "README.md").read_text()
_SNIPPET = re.compile(r"^```python\n(.*?)^```", re.M | re.S)
SNIPPETS = _SNIPPET.findall(README)
RECIPE = "\n".join(_SNIPPET.findall((ROOT / "CONTRIBUTING.md").read_text()))
