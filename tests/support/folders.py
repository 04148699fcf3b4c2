"""Where tests find files: the project, its data, stored references, and measurements that are not its own."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DATA = ROOT / "data"
REFERENCE = ROOT / "tests" / "reference"
TYRE = ROOT.parent / "shared" / "data" / "tyre"
