"""Phrases that make a reader stop do not come back: docstrings, comments, messages and pages."""

import ast
import io
import json
import re
import subprocess
import tokenize

import pytest
from support.folders import ROOT

FILES = [
    ROOT / name
    for name in subprocess.run(
        ["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False
    ).stdout.splitlines()
    if not name.startswith("tests/reference/") and name != "tests/project/test_prose.py"
]
# Phrase, and the wording that replaces it.
PHRASES = {
    r"\bthat which\b": "name the thing",
    r"^(?:Of|What|Whether|Those|That which)\b(?!.*\?)": "begin with the subject or an imperative",
    r"\bhangs? on\b": "depends on",
    r"\b(?:is|are) told\b": "is reported",
    r"\bsoftens? apart\b": "separate storage and loss factors",
    r"\b(?:is|are) worth\b": "error, accuracy or effective sample size",
    r"\bof (?:its|their) own\b": "separate, or its",
    r"\bis none\b|\bany more\b": "is not, no longer",
    r"\bthe same of\b": "name the thing",
    r"\bbut for (?:its|the|a)\b": "except",
    r"\bfar sight\b|\banew\b": "name the property; again",
}


def pieces(path):
    """Yield (line, text) of docstrings, comments, messages or Markdown of a file."""
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".ipynb":
        cells = [cell for cell in json.loads(text)["cells"] if cell["cell_type"] == "markdown"]
        yield from ((0, line) for cell in cells for line in "".join(cell["source"]).splitlines())
    elif path.suffix == ".md":
        yield from enumerate(re.sub(r"^```.*?^```", "", text, flags=re.M | re.S).splitlines(), 1)
    else:
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node):
                # The first line alone can begin with such a word.
                first, *others = ast.get_docstring(node).splitlines()
                yield node.body[0].lineno, first
                yield from ((node.body[0].lineno, "  " + line) for line in others)
            elif isinstance(node, ast.Raise):
                constants = [part for part in ast.walk(node) if isinstance(part, ast.Constant)]
                yield from ((part.lineno, f" {part.value}") for part in constants)
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type == tokenize.COMMENT:
                yield token.start[0], token.string.lstrip("# ")


def faults(path):
    return [
        f"{path.relative_to(ROOT)}:{line}: {text.strip()!r}: {advice}"
        for line, text in pieces(path)
        for phrase, advice in PHRASES.items()
        if re.search(phrase, text)
    ]


@pytest.mark.parametrize("phrase", ["Whether F differs.", "It hangs on q.", "There is none."])
def test_a_phrase_is_found(phrase, tmp_path):
    page = tmp_path / "page.md"
    page.write_text(phrase)
    assert any(re.search(pattern, text) for _, text in pieces(page) for pattern in PHRASES)


@pytest.mark.skipif(not FILES, reason="needs git")
def test_prose_is_plain():
    found = [line for path in FILES if path.suffix in (".py", ".md", ".ipynb") for line in faults(path)]
    assert not found, "\n".join(found)


def wrong_parameters(text):
    """Yield (line, name) of names in the section Parameters of docstrings that are not parameters."""
    for node in ast.walk(ast.parse(text)):
        docstring = ast.get_docstring(node) if isinstance(node, ast.FunctionDef) else None
        _, section, entries = (docstring or "").partition("Parameters\n----------\n")
        if not section:
            continue
        arguments = [part.arg for part in ast.walk(node.args) if isinstance(part, ast.arg)]
        for names in re.findall(r"^([\w*, ]+) : ", re.split(r"\n\n(?=\w)", entries)[0], flags=re.M):
            for name in names.replace("*", "").split(", "):
                if name not in [*arguments, "other arguments"]:
                    yield node.lineno, name


def test_a_wrong_parameter_is_found():
    section = "Parameters\n    ----------\n    a, d : numbers\n    *b, c : more numbers\n"
    text = f'def f(a, *b, c=1):\n    """Return.\n\n    {section}    """'
    assert list(wrong_parameters(text)) == [(1, "d")]


def test_docstrings_name_the_parameters_of_their_functions():
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {name}: is not a parameter"
        for folder in ("rubberfric", "fitting")
        for path in sorted((ROOT / folder).rglob("*.py"))
        for line, name in wrong_parameters(path.read_text(encoding="utf-8"))
    ]
    assert not wrong, "\n".join(wrong)
