"""Messages and reports in the words of the command that prints them, for all advice in the sources."""

import ast
import contextlib
import inspect
import re
from pathlib import Path

import pytest
from support.folders import DATA, ROOT

import fitting
from fitting.commands import arguments, job, options
from fitting.solvers.options import FILE_OPTIONS
from rubberfric.commands import Parser, reworded, use_words_of
from rubberfric.commands.arguments import parser
from rubberfric.commands.main import main as scene_main
from rubberfric.commands.wording import CALLS

PARSERS = {name: command.parser for name, command in arguments.COMMANDS.items()}
# Keys of job files and of scene files, which are lines of TOML.
JOB_KEYS = {*job.CONDITIONS, *job.TEXTS, *job.EXTRA, *job.RULE_KEYS, *FILE_OPTIONS}
SCENE_KEYS = {"columns", "contact_model", "bad_rows", "poisson", "shift", "normalisation", "hurst", "patch"}
# Arguments of functions that no command calls, and of constructors.
ONLY_PYTHON = {"flat", "pooled", "surface", "temperature"}
# Figures: options of matplotlib.
DRAWN = {"pad"}


@pytest.fixture(autouse=True)
def no_words_left():
    yield
    use_words_of({})


def texts():
    """Yield all strings of the sources except docstrings, with the name of the file."""
    for package in ("rubberfric", "fitting"):
        for path in sorted((ROOT / package).rglob("*.py")):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            scopes = (ast.Module, ast.ClassDef, ast.FunctionDef)
            documented = [n.body[0] for n in ast.walk(tree) if isinstance(n, scopes) and n.body]
            docstrings = {id(n.value) for n in documented if isinstance(n, ast.Expr)}
            for node in ast.walk(tree):
                is_text = isinstance(node, ast.Constant) and isinstance(node.value, str)
                if is_text and id(node) not in docstrings:
                    yield path.relative_to(ROOT), node.value


def advised():
    """Return a dict from the name of a keyword argument in a message to the file of the message."""
    found = {}
    for path, text in texts():
        if {"explorer", "html.py", "progress.py", "wording.py"} & set(path.parts):
            continue
        for name in re.findall(r"(?<![\w.`-])([a-z][a-z0-9_]{2,})=(?=[\w\"'\[.]|$)", text):
            found[name] = path
    return found


def test_everything_that_a_message_recommends_exists_in_a_command_or_its_file():
    options = {name for make in PARSERS.values() for name in make().options}
    known = options | JOB_KEYS | SCENE_KEYS | ONLY_PYTHON | DRAWN
    assert {name: path for name, path in advised().items() if name not in known} == {}
    assert {"bad_rows", "columns", "check_units", "starts", "loss", "vertical", "resume"} <= set(advised())


def test_a_job_has_every_option_of_reading_as_an_option_and_as_a_key():
    wanted = {
        name
        for name, one in inspect.signature(fitting.read).parameters.items()
        if one.kind == one.KEYWORD_ONLY
    }
    assert set(options.READING) == wanted
    assert wanted <= set(PARSERS["job"]().options)
    assert wanted <= {*job.CONDITIONS, *job.TEXTS, *job.EXTRA}


def test_calls_that_are_replaced_are_in_the_sources():
    everything = [text for path, text in texts() if path.name != "wording.py"]
    for call in CALLS:
        assert any(call.strip() in text for text in everything), call


@pytest.mark.parametrize(
    ("command", "text", "expected"),
    [
        ("job", '; bad_rows="drop" leaves out', "; --bad-rows drop leaves out"),
        ("fit", '; bad_rows="drop" leaves out', '; bad_rows = "drop" leaves out'),
        ("job", ': columns=["v [mm/s]", "?", "-"]', ': --columns "v [mm/s]" "?" "-"'),
        ("fit", ': columns=["v [mm/s]", "?"]', ': columns = ["v [mm/s]", "?"]'),
        ("job", "or give pressure=... [Pa]", "or give --pressure ... [Pa]"),
        ("job", "(check_units=False accepts it)", "(--no-check-units accepts it)"),
        ("fit", "(check_units=False accepts it)", "(check_units = false accepts it)"),
        ("fit", "continue it with resume=True, or", "continue it with --resume, or"),
        ("fit", "starts=8 looks for a lower", "starts = 8 looks for a lower"),
        ("fit", "Quadrature(order=10, ratio=6.0), float32", "Quadrature(order=10, ratio=6.0), float32"),
        ("mastercurve", 'vertical="entropic" removes it', "--vertical entropic removes it"),
        ("mastercurve", "a.csv: temperature = 2.0: must not", "a.csv: --temperature 2.0: must not"),
        ("spectrum", "a.csv: normalisation is missing: must", "a.csv: --normalisation is missing: must"),
        ("fit", "job.toml: data[0].pressure = 3.0: must", "job.toml: data[0].pressure = 3.0: must"),
        ("job", "FrictionData.temperature = 3.0: must", "FrictionData.temperature = 3.0: must"),
        ("job", "; rubberfric.io.read_traces reads them", "; `rubberfric-fit spectrum` reads them"),
        ("job", "v >= 0, x==y, a = b", "v >= 0, x==y, a = b"),
    ],
)
def test_words(command, text, expected):
    use_words_of(PARSERS[command]().options)
    assert reworded(text) == expected


def test_without_a_command_texts_stay():
    text = 'bad_rows="drop" leaves out such rows'
    assert reworded(text) == text


def test_options_of_one_parser():
    one = Parser()
    one.add_argument("file")
    one.add_argument("--two-words", dest="other")
    assert set(one.options) == {"help", "other"}


SCENE = DATA / "tread_on_asphalt.toml"
BAD_ROW = "v;mu;p\nm/s;-;Pa\n1e-3;0.1;2e5\n1e-2;;2e5\n1e-1;0.3;2e5\n1;0.4;2e5\n"
UNKNOWN_TITLES = "v [mm/s]\tA [N]\tB [N]\n0.1\t100\t0.8\n1\t100\t0.9\n"


@pytest.mark.parametrize(
    ("text", "advice", "follow"),
    [
        (BAD_ROW, "--bad-rows drop", ("--bad-rows", "drop")),
        (UNKNOWN_TITLES, '--columns "v [mm/s]" "?" "?"', ("--columns", "v [mm/s]", "p [kPa]", "mu")),
    ],
)
def test_the_advice_of_job_works(run, text, advice, follow):
    Path("table.csv").write_text(text)
    given = ("job", SCENE, "table.csv", "--temperature", "293", "--out", "job.toml")
    status, _, complaint = run(*given)
    assert status == 2 and advice in complaint and not Path("job.toml").exists()
    warns = pytest.warns(UserWarning, match=r"table\.csv") if "drop" in follow else contextlib.nullcontext()
    with warns:
        assert run(*given, *follow)[0] == 0
    assert Path("job.toml").exists()


@pytest.mark.slow
@pytest.mark.usefixtures("run")
def test_the_advice_about_a_table_of_a_scene_works(call_main):
    """The key is in the table of the scene file that names the CSV file."""
    rows = "1;1e6;1e5\n10;;1e5\n100;2e6;2e5\n1e3;3e6;4e5\n"
    Path("moduli.csv").write_text(f"omega;E_stor;E_loss\nrad/s;Pa;Pa\n{rows}")
    scene = SCENE.read_text().split("[upper.material]")[0] + (
        '[upper.material]\nkind = "tabulated"\nfile = "moduli.csv"\n[run]\nvelocity = 0.1\npressure = 1e5\n'
    )
    Path("scene.toml").write_text(scene)
    status, _, complaint = call_main(scene_main, "run", "scene.toml", "--no-cache")
    assert status == 2 and 'bad_rows = "drop" leaves out such rows' in complaint
    Path("scene.toml").write_text(scene.replace('"moduli.csv"', '"moduli.csv"\nbad_rows = "drop"'))
    with pytest.warns(UserWarning, match=r"moduli\.csv"):
        status, printed, complaint = call_main(scene_main, "run", "scene.toml", "--no-cache")
    assert (status, complaint) == (0, "") and "mu" in printed


def test_explore_has_the_options_for_its_data():
    options = ["--data", "d.csv", "--columns", "v", "mu", "--bad-rows", "drop"]
    given = parser().parse_args(["explore", "s.toml", *options])
    assert (given.columns, given.bad_rows) == (["v", "mu"], "drop")
