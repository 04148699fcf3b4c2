"""Where tests find files: the project, its data, stored references, and measurements that are not its own."""

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "data"
REFERENCE = ROOT / "tests" / "reference"
# Of programs that import from here. The project stands first: folders of tests have its packages' names.
PYTHONPATH = os.pathsep.join([str(ROOT), str(ROOT / "tests")])
TYRE = ROOT.parent / "shared" / "data" / "tyre"
