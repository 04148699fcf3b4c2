"""Tables of scenes and results in notebooks, and progress."""

import gc
import io
import sys
import types

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from support.html_tables import cells, pairs
from support.scenes.examples import EXAMPLES, examples

import rubberfric as rf
from rubberfric.base.objects.html import short, with_unit
from rubberfric.base.progress import Progress, TerminalLine, _Notebook, describe
from rubberfric.io.results import Conditions, Result


@pytest.mark.parametrize("name", EXAMPLES)
def test_every_object_is_a_table_of_its_key_paths(name):
    value = EXAMPLES[name]
    found = pairs(value)
    for path, leaf in jax.tree_util.tree_leaves_with_path(value):
        shown = found[".".join(key.name for key in path)]
        if np.ndim(leaf) == 0:
            assert float(shown.split()[0]) == pytest.approx(float(leaf), rel=1e-5)
    assert f"<b>{name}</b>" in value._repr_html_()
    assert "<table>" not in repr(value)


def test_scene_in_full():
    scene = rf.Scene(rf.Body(rf.Rigid(), EXAMPLES["SelfAffine"]), rf.Body(EXAMPLES["Prony"]))
    assert pairs(scene) == {
        "key path": "value",
        "lower": "Body",
        "lower.material": "Rigid",
        "lower.spectrum": "SelfAffine",
        "lower.spectrum.q0": "100 1/m",
        "lower.spectrum.qr": "1000 1/m",
        "lower.spectrum.q1": "100000 1/m",
        "lower.spectrum.hurst": "0.8",
        "lower.spectrum.h_rms": "0.0001 m",
        "upper": "Body",
        "upper.material": "Prony",
        "upper.material.E_inf": "1e+06 Pa",
        "upper.material.E": "1e+06, 2e+06, 3e+06 Pa",
        "upper.material.tau": "0.001, 1, 100 s",
        "upper.material.poisson": "0.5",
        "upper.material.shift": "WLF",
        "upper.material.shift.C1": "8",
        "upper.material.shift.C2": "100 K",
        "upper.material.shift.T_ref": "293 K",
        "gamma": "0.5",
        "area_correction": "False",
        "contact_model": "paper",
    }


def test_single_precision_is_not_shown_as_more():
    single = examples(np.float32, lambda x: np.array(x, np.float32))
    for name, value in single.items():
        assert value._repr_html_() == EXAMPLES[name]._repr_html_()


def test_traced_scenes_show_that_and_compute_nothing():
    seen = {}

    def keep(scene):
        seen["html"] = pairs(scene)
        return 0.0

    jaxpr = jax.make_jaxpr(keep)(EXAMPLES["Scene"])
    assert not jaxpr.eqns
    assert seen["html"]["gamma"] == "traced, float64"
    assert seen["html"]["lower.material.E"] == "traced, float64 (3)"
    jax.vmap(keep)(jax.tree.map(lambda x: jnp.stack([x, x]), EXAMPLES["Scene"]))
    assert seen["html"]["gamma"] == "traced, float64"


def test_what_maps_put_in_place_of_numbers_is_shown_too():
    assert pairs(jax.tree.map(lambda _: "<b>", EXAMPLES["Elastic"]))["young"] == "<b> Pa"
    shapes = jax.eval_shape(lambda x: x, EXAMPLES["Elastic"])
    assert "ShapeDtypeStruct" in pairs(shapes)["young"]
    stacked = jax.tree.map(lambda x: jnp.stack([x, 2 * x]), EXAMPLES["Prony"])
    assert pairs(stacked)["tau"] == "0.001 … 200 s (2 x 3)"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (np.arange(4), "0 … 3 m (4)"),
        (np.zeros(0), "empty"),
        (np.zeros((0, 2)), "empty (0 x 2)"),
        (np.array([True, False]), "1, 0 m"),
        (-0.0, "-0 m"),
        (np.array([np.nan, np.inf]), "nan, inf m"),
        (np.ones((1, 1)), "1 … 1 m (1 x 1)"),
        (jnp.float32(0.1), "0.1 m"),
    ],
    ids=str,
)
def test_values_in_a_few_characters(value, text):
    assert with_unit(short(value), "m") == text


def test_result():
    values = np.arange(2 * 1 * 4.0).reshape(2, 1, 4)
    conditions = Conditions(np.geomspace(1e-3, 1.0, 4), np.array([1e5]), np.array([283.15, 293.15]))
    solution = rf.Solution(friction=values, separation=1e-6 * values, converged=values > 1)
    result = Result(EXAMPLES["Scene"], conditions, solution, rf.Quadrature(), "<script>alert(1)</script>")
    found = pairs(result)
    assert found["velocity"] == "0.001 … 1 m/s (4)" and found["pressure"] == "100000 Pa"
    assert found["temperature"] == "283.15, 293.15 K"
    assert found["friction"] == "0 … 7 (2 x 1 x 4)" and found["separation"] == "0 … 7e-06 m (2 x 1 x 4)"
    assert found["converged"] == "6 of 8" and found["lower.spectrum.q0"] == "100 1/m"
    assert "<script" not in result._repr_html_() and "&lt;script&gt;" in result._repr_html_()
    cold = result._replace(conditions=conditions._replace(temperature=None), title="")
    assert "temperature" not in pairs(cold) and "<b>Result</b>" in cold._repr_html_()


class Terminal(io.StringIO):
    def isatty(self):
        return True


def terminal_of_a_program(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.delitem(sys.modules, "IPython", raising=False)
    return sys.stderr


def test_lines_of_progress_in_a_terminal(monkeypatch):
    terminal = terminal_of_a_program(monkeypatch)
    tell = rf.progress("map")
    tell(0, 200)
    tell(100, 200)
    assert terminal.getvalue().startswith("\r\033[Kmap: 200 points,   0 %\r\033[Kmap: 200 points,  50 %, ")
    assert not terminal.getvalue().endswith("\n")
    del tell
    gc.collect(1)
    assert terminal.getvalue().endswith(" s left\n")
    with rf.progress() as tell:
        tell("x" * 200)
    assert terminal.getvalue().endswith("\n\r\033[K" + "x" * 79 + "\n")


def test_words_of_progress():
    assert describe(0, 8, 5.0) == ("8 points,   0 %", 0.0)
    assert describe(2, np.int64(8), 3.0) == ("8 points,  25 %, 9 s left", 0.25)
    assert describe(8, 8, 12.4) == ("8 points, 100 %, 12 s", 1.0)
    assert describe(0, 0, 0.0) == ("0 points,   0 %", 0.0)
    assert describe(3, 0.125, 2.0) == ("step 3, cost 0.125, 2 s", None)
    assert describe("reference", None, 1.0) == ("reference", None)


def test_a_line_is_ended_once_and_survives_a_closed_terminal():
    terminal = Terminal()
    with Progress("", TerminalLine(terminal)) as tell:
        pass
    assert terminal.getvalue() == ""
    tell(1, 2.0)
    terminal.close()
    del tell
    place = TerminalLine(Terminal())
    place.show("a", None)
    place.end()
    place.end()
    assert place._stream.getvalue() == "\r\033[Ka\n"
    place._stream.close()
    place._open = True
    place.end()


class Page:
    """Stands for the page of a notebook."""

    def __init__(self):
        self.shown = []

    def display(self, picture, display_id=False):
        assert display_id is True
        self.shown.append(picture)
        return types.SimpleNamespace(update=lambda new: self.shown.__setitem__(-1, new))


def ipython(monkeypatch, shell, page):
    display = types.SimpleNamespace(display=page.display)
    fake = types.SimpleNamespace(get_ipython=lambda: shell, display=display)
    monkeypatch.setitem(sys.modules, "IPython", fake)
    monkeypatch.setitem(sys.modules, "IPython.display", display)


def test_bar_of_a_notebook(monkeypatch):
    page, terminal = Page(), terminal_of_a_program(monkeypatch)
    ipython(monkeypatch, types.SimpleNamespace(kernel=object()), page)
    tell = rf.progress("a <map>")
    tell(0, 4)
    assert cells(page.shown[0]) == []
    assert page.shown[0]._repr_html_() == (
        "<div><progress max='1' value='0.0000'></progress> a &lt;map&gt;: 4 points,   0 %</div>"
    )
    tell(4, 4)
    assert len(page.shown) == 1 and repr(page.shown[0]).startswith("a <map>: 4 points, 100 %")
    assert terminal.getvalue() == ""


def test_notebook_gets_few_messages_and_the_last_one():
    page = Page()
    times = iter([0.0, 0.01, 0.5, 0.5, 0.51])
    tell = Progress("fit", _Notebook(page.display, times.__next__), lambda: 0.0)
    tell(1, 5.0)
    tell(2, 4.0)
    assert repr(page.shown[0]) == "fit: step 1, cost 5, 0 s"
    tell(3, 3.0)
    assert repr(page.shown[0]) == "fit: step 3, cost 3, 0 s" and "progress" not in page.shown[0]._repr_html_()
    tell(4, 2.0)
    assert repr(page.shown[0]).startswith("fit: step 3")
    del tell
    gc.collect(1)
    assert repr(page.shown[0]).startswith("fit: step 4") and len(page.shown) == 1


def test_silent_elsewhere(monkeypatch, capsys):
    page = Page()
    ipython(monkeypatch, types.SimpleNamespace(), page)  # a shell without a kernel: a terminal's
    with rf.progress("map") as tell:
        tell(1, 2)
    ipython(monkeypatch, None, page)
    monkeypatch.setattr(sys, "stderr", None)
    rf.progress("map")(1, 2)
    assert not page.shown and capsys.readouterr() == ("", "")


def test_wrong_label():
    with pytest.raises(ValueError, match=r"^label = 'a\\nb': must be text on one line$"):
        rf.progress("a\nb")
    with pytest.raises(ValueError, match=r"^label = 3: must be text on one line"):
        rf.progress(3)


def test_a_map_tells_its_progress(monkeypatch):
    terminal = terminal_of_a_program(monkeypatch)
    smooth = rf.Scene(rf.Body(rf.Rigid()), rf.Body(rf.Elastic(1e6, 0.5)))
    rf.friction_map(smooth, [1.0, 2.0, 3.0], 1e5, block=2, progress=rf.progress("map"))
    gc.collect(1)
    shares = [line.split("%")[0].split(",")[1].strip() for line in terminal.getvalue().split("\r")[1:]]
    assert shares == ["0", "66", "100"] and terminal.getvalue().endswith("s\n")
