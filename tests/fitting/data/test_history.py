"""Data say what was done to them: in Python, in HTML, in files, and in reports of fits."""

import re

import numpy as np
import pytest
from support.exports import put

import fitting

LINES = ("mu = |F_t| / |F_n|", "p = |F_n| / area, area = 0.0004")


@pytest.fixture
def data(tmp_path):
    return fitting.read(put(tmp_path, "v [mm/s],Fn [N],Ft [N]\n5,100,80\n50,100,90\n"), area=4e-4)


def test_what_was_done(data):
    assert data.history == LINES
    assert repr(data).endswith(f"; {LINES[0]}; {LINES[1]}>")
    text = data._repr_html_()
    assert all(line in re.sub("<[^>]*>", "", text) for line in LINES) and "0.005 ... 0.05 m/s" in text
    assert fitting.FrictionData([1.0], [0.5], pressure=1e5).history == ()


def test_files_keep_the_history(data, tmp_path):
    data.write(tmp_path / "data.h5")
    again = fitting.read(tmp_path / "data.h5")
    assert again.history == LINES
    np.testing.assert_array_equal(again.friction, [0.8, 0.9])
    data.write(tmp_path / "data.csv")
    assert (tmp_path / "data.csv").read_text().startswith(f"# {LINES[0]}\n# {LINES[1]}\nv,mu,p\n")
    assert fitting.read(tmp_path / "data.csv").history == ()


def test_a_selection_and_rows_left_out(tmp_path):
    path = put(tmp_path, "v [mm/s];mu;p [bar]\n5;0.8;2\n50;;2\n500;0.9;2\n")
    with pytest.warns(UserWarning, match="left out: line 3"):
        data = fitting.read(path, bad_rows="drop")
    assert data.history == ("1 of 3 rows have bad values and are left out: line 3",)
    chosen = data.selected(velocity=(0.1, None))
    assert chosen.history[1:] == ("1 of 2 points selected: velocity = (0.1, None)",)


def test_moduli_say_which_relations_were_used():
    frame = {"f [Hz]": [1.0], "G* [MPa]": [1.0], "delta [deg]": [30.0]}
    data = fitting.read(frame, poisson=0.5)
    np.testing.assert_allclose([data.storage, data.loss], 3e6 * np.array([[0.75**0.5], [0.5]]), rtol=1e-14)
    assert data.history == (
        "tan_del = tan(delta)",
        "G_stor = G_comp / sqrt(1 + tan_del^2)",
        "E_stor = 2 (1 + poisson) G_stor, poisson = 0.5",
        "E_loss = E_stor tan_del",
    )


@pytest.mark.parametrize("history", ["text", 3, ("a", 1), ("two\nlines",)])
def test_a_wrong_history(history):
    with pytest.raises(ValueError, match=r"^FrictionData\.history = .*must be"):
        fitting.FrictionData([1.0], [0.5], pressure=1e5, history=history)
