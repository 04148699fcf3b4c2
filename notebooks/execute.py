"""Run notebooks from top to bottom and store them as the project keeps them.

    python notebooks/execute.py [1_first_contact.ipynb ...]    # all of them without a name

Needs `pip install 'rubberfric[notebooks]'`. Stored notebooks have stable cell names (cell-01, cell-02, ...)
and no metadata of the machine or the run. Pictures have a palette of 127 colours, which takes a third of the
bytes without a visible difference.
"""

import base64
import io
import sys
from pathlib import Path

import nbclient
import nbformat
from PIL import Image  # comes with matplotlib

FOLDER = Path(__file__).resolve().parent
# Colours of a stored picture. Twice as many make a picture 15 % larger.
COLOURS = 127


def run(notebook, folder):
    """Execute a notebook in place, in a new kernel that works in a folder."""
    client = nbclient.NotebookClient(
        notebook, timeout=600, kernel_name="python3", resources={"metadata": {"path": str(folder)}}
    )
    client.execute()


def tidy(notebook):
    """Remove everything that is not stored."""
    notebook.metadata = nbformat.from_dict(
        {
            "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
            "language_info": {"name": "python"},
        }
    )
    for i, cell in enumerate(notebook.cells, 1):
        cell.id = f"cell-{i:02d}"
        cell.metadata = nbformat.from_dict({})
        for output in cell.get("outputs", ()):
            if "metadata" in output:
                output.metadata = nbformat.from_dict({})
            data = output.get("data", {})
            if "image/png" in data:
                data["image/png"] = smaller(data["image/png"])
                data["text/plain"] = "<figure>"


def smaller(png):
    """Return a picture (base64) with a palette."""
    picture = Image.open(io.BytesIO(base64.b64decode(png)))
    flat = Image.alpha_composite(Image.new("RGBA", picture.size, "white"), picture.convert("RGBA"))
    stored = io.BytesIO()
    # No dithering, so that areas of one colour stay uniform.
    flat.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(
        stored, "png", optimize=True, dpi=picture.info.get("dpi", (150, 150))
    )
    return base64.b64encode(stored.getvalue()).decode() + "\n"


def main(names):
    """Run and store the notebooks named, or all."""
    for path in [FOLDER / name for name in names] or sorted(FOLDER.glob("*.ipynb")):
        notebook = nbformat.read(path, as_version=4)
        run(notebook, FOLDER)
        tidy(notebook)
        nbformat.write(notebook, path)
        print(f"{path.name}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main(sys.argv[1:])
