"""Draw the pictures of gallery.md by running its lines: `python notebooks/gallery.py`."""

import os
import re
import shutil
import sys
import tempfile
from pathlib import Path

PAGE = Path(__file__).with_name("gallery.md")
FOLDER = Path(__file__).parent / "figures" / "gallery"


def snippets():
    """Return the Python code of the page, a text for each block."""
    return re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.M | re.S)


def main():
    """Run all blocks in a copy of the data, and move the pictures to figures/gallery."""
    root = Path(__file__).resolve().parent.parent
    sys.path.insert(0, str(root))
    FOLDER.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(root / "data", Path(folder) / "data")
        os.chdir(folder)
        names = {}
        for text in snippets():
            exec(compile(text, PAGE.name, "exec"), names)
        for picture in Path(folder).glob("*.png"):
            shutil.copy(picture, FOLDER / picture.name)


if __name__ == "__main__":
    main()
