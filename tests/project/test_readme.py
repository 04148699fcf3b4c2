"""Pages: their snippets run, names exist, and the reference is complete."""

import pydoc
import re
import tomllib
from pathlib import Path

import jax
import pytest
from support.folders import PAGE_SNIPPETS, REFERENCE_NAMES, ROOT, SNIPPETS

import fitting
import rubberfric
import rubberfric as rf


@pytest.mark.usefixtures("in_a_copy")
def test_snippets(capsys):
    assert len(SNIPPETS) >= 2
    names = {}
    for snippet in SNIPPETS:
        exec(compile(snippet, "README.md", "exec"), names)
    assert capsys.readouterr().out
    # A hundred steps of README's optimiser reduce the mean square of ln(mu / measured), from 6.65.
    assert float(names["value"]) < 0.2


def run_page(name):
    """Run the snippets of a page one after the other, and return their names."""
    names = {}
    for snippet in PAGE_SNIPPETS[name]:
        exec(compile(snippet, f"{name}.md", "exec"), names)
    return names


@pytest.mark.slow  # notebook 5 runs the same steps
@pytest.mark.usefixtures("in_a_copy")
def test_start_here(capsys):
    assert "explains the data" in run_page("start_here")["result"].report()
    assert capsys.readouterr().out


@pytest.mark.usefixtures("in_a_copy")
def test_other_pages_need_no_other_page():
    assert bool(run_page("how_true")["contact"].converged)
    # Tests run in double precision, so they do not show that a page leaves it out.
    assert 'jax.config.update("jax_enable_x64", True)' in PAGE_SNIPPETS["how_true"][0]
    run_page("troubleshooting")
    names = run_page("options")
    assert float(names["mu"]) == pytest.approx(float(rf.friction(names["scene"], 0.01, 0.15e6)), rel=1e-12)
    wrong, _ = jax.jit(names["friction"])(0.01, -1.0)
    assert "pressure = -1.0: must be > 0" in wrong.get()


@pytest.mark.slow
@pytest.mark.usefixtures("in_a_copy")
def test_gallery_draws_its_pictures():
    text, names = (ROOT / "notebooks" / "gallery.md").read_text(), {}
    for snippet in re.findall(r"^```python\n(.*?)^```", text, re.M | re.S):
        exec(compile(snippet, "gallery.md", "exec"), names)
    drawn = {path.name for path in Path().glob("*.png")}
    shown = re.findall(r"\(figures/gallery/([\w.]+)\)", text)
    assert drawn == set(shown) and len(shown) == 9
    for name in shown:
        assert (ROOT / "notebooks" / "figures" / "gallery" / name).stat().st_size > 10_000


def test_citations_agree():
    """Each author, title, version and address of CITATION.cff is in the BibTeX entries."""
    entries = (ROOT / "notebooks" / "cite.md").read_text()
    text = (ROOT / "CITATION.cff").read_text()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert f"\nversion: {rf.__version__}\n" in text and f"\nlicense: {project['license']}\n" in text
    assert all(f"  - {word}\n" in text for word in project["keywords"])
    assert "arXiv:1506.06955" in text
    values = re.findall(r"^ *(?:- )?(?:title|version|year|url|name|license|family-names): (.+)$", text, re.M)
    assert len(values) == 9 and f"version = {{{rubberfric.__version__}}}" in entries
    for value in values:
        assert value in entries, value


PAGES = (
    *("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "data/README.md", "notebooks/README.md"),
    *(
        f"notebooks/{name}.md"
        for name in (
            *("accuracy_and_cost", "commands", "how_true", "jax_libraries", "options", "start_here"),
            "troubleshooting",
        )
    ),
)
NAMED = re.compile(r"(?:rubberfric|fitting|tests|notebooks|data)/[\w./]+\.(?:py|md|toml|csv|json|ipynb)")


@pytest.mark.parametrize("page", PAGES)
def test_files_that_are_named_exist(page):
    text = (ROOT / page).read_text()
    for name in re.findall(r"\]\(([\w./]+)\)", text):
        assert ((ROOT / page).parent / name).exists(), name
    for name in NAMED.findall(text):
        assert (ROOT / name).exists(), name


@pytest.mark.parametrize("page", PAGES)
def test_modules_that_are_named_exist(page):
    now = "\n".join(line for line in (ROOT / page).read_text().splitlines() if not line.startswith("| `rf."))
    for name in re.findall(r"(?<![/\w])((?:rf|rubberfric|fitting)(?:\.[a-zA-Z_]\w*)+)", now):
        package, *attributes = name.split(".")
        found = {"rf": rubberfric, "rubberfric": rubberfric, "fitting": fitting}[package]
        for attribute in attributes:
            found = getattr(found, attribute)


def test_reference_has_every_public_name():
    assert len(REFERENCE_NAMES) == len(set(REFERENCE_NAMES)) > 150
    there = [pydoc.locate(name) for name in REFERENCE_NAMES]
    assert None not in there
    rooms = [
        getattr(rubberfric, name) for name in ("analysis", "io", "materials", "plot", "roughness", "units")
    ]
    for package in (rubberfric, *rooms, fitting, fitting.plot):
        for name in getattr(package, "__all__", None) or [n for n in vars(package) if not n.startswith("_")]:
            public = getattr(package, name)
            if callable(public):
                assert any(public is one for one in there), f"{package.__name__}.{name}"
