"""A stranger's session: from a folder of exports to a fit with verdict; nothing edited, all messages shown.

    python -m pytest -m slow -s tests/fitting/whole_fits/test_stranger.py

The folder is a copy of data/laboratory. The second session is of somebody who makes mistakes: each is
answered by one line that says what to do.
"""

import contextlib
import hashlib
import io
import re
import shutil
import textwrap
import warnings

import pytest
from support.folders import DATA

from fitting.commands.main import main as fit_main
from rubberfric.commands.main import main as scene_main

MOST = 10  # commands or cells

SESSION = (
    """
    import jax, numpy as np, rubberfric as rf, fitting
    jax.config.update("jax_enable_x64", True)
    """,
    """
    curve = fitting.fit_master_curve(fitting.read("dma_isothermen.csv"))
    series = fitting.fit_prony(curve.data, 2.0, shift=curve.shift)
    """,
    """
    x, traces = rf.io.read_traces("stylus.csv")
    road = fitting.fit_spectrum(rf.roughness.spectrum_of_profile(x, traces, per_decade=10))
    """,
    """
    sweep = rf.io.read_table("strain_sweep.txt", ["strain", "E_stor", "E_loss"])
    softening = fitting.softening_from_sweep(*sweep.values())
    """,
    """
    friction = fitting.read("linear_tester.csv", relative=0.05)
    """,
    """
    scene = rf.Scene(
        rf.Body(rf.Rigid(), rf.with_cutoff(road.spectrum, 1.3)),
        rf.Body(series.material),
        shear=rf.ContactShear(tau_f0=5e6, c=0.2, v0=1e-2, shift=rf.Arrhenius(1.0, 293.15)),
        softening=softening,
    )
    """,
    """
    names = "shear.tau_f0", "shear.c", "shear.v0", "shear.shift.energy", "lower.spectrum.q1", *road.fit.names
    result = fitting.fit(scene, friction, dict.fromkeys(names, fitting.Positive()), prior=road.fit.as_prior())
    """,
    """
    print(result.report())
    """,
)
# Relative to the truth in data/make_laboratory.py.
TRUTH = {"shear.tau_f0": 2e6, "shear.c": 0.1, "shear.v0": 6e-3, "lower.spectrum.h_rms": 1.5e-4}


def entered(cell, names):
    """Return the output, warnings and error of a cell, as in a terminal."""
    printed = io.StringIO()
    with warnings.catch_warnings(record=True) as caught, contextlib.redirect_stdout(printed):
        warnings.simplefilter("always")
        try:
            exec(compile(cell, "cell", "exec"), names)
            ended = ""
        except ValueError as error:
            ended = f"ValueError: {error}"
    said = [f"{one.category.__name__}: {one.message}" for one in caught]
    answer = "\n".join([*said, *filter(None, (ended, printed.getvalue().rstrip()))])
    print("\n".join(f">>> {line}" for line in cell.splitlines()))
    print(answer)
    return answer


def sums(folder):
    return {path.name: hashlib.sha256(path.read_bytes()).digest() for path in folder.iterdir()}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    for path in (DATA / "laboratory").iterdir():
        shutil.copy(path, tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
def test_from_a_folder_of_exports_to_a_verdict(folder):
    before, names = sums(folder), {}
    assert len(SESSION) <= MOST
    answers = [entered(textwrap.dedent(cell).strip(), names) for cell in SESSION]
    assert answers[:-1] == [""] * (len(SESSION) - 1)  # no message on the way
    result = names["result"]
    assert result.verdict.explains and "[[Verdict]]" in answers[-1]
    for path, truth in TRUTH.items():
        assert abs(result[path].value - truth) < 3 * result[path].stderr, path
    assert sums(folder) == before


# Attempts, and words of the messages.
MISTAKES = (
    ("import rubberfric as rf, fitting", ""),
    ('fitting.read("linear_tester.xls")', "suffix '.xls': must be .csv"),
    ('rf.io.read_columns("stylus.csv")', "rubberfric.io.read_traces reads them"),
    ('fitting.fit_prony(fitting.read("dma_isothermen.csv"), 2.0)', "fit_master_curve"),
    ('fitting.read("strain_sweep.txt")', 'read_table(path, ["strain", "E_stor", "E_loss"])'),
    ('friction = fitting.read("linear_tester.csv", relative=5)', "is it in percent? 3 % is 0.03"),
    ('friction = fitting.read("linear_tester.csv", relative=0.05)', ""),
    ("road = rf.Body(rf.Rigid(), rf.SelfAffine(100.0, 1e3, 3e4, 0.8, 5e-4))", ""),
    ("rf.Scene(road, rf.Body(rf.Prony(3.6, [1e9], [1e-6])))", "UnitWarning"),
    ("scene = rf.Scene(road, rf.Body(rf.Prony(3.6e6, [1e9], [1e-6])))", ""),
    ('fitting.fit(scene, friction, ["lower.spectrum.hurst"])', "free: must be a dict of key paths"),
    (
        'fitting.fit(scene, friction, {"lower.spectrum.Hurst": fitting.Positive()})',
        "did you mean 'lower.spectrum.hurst'",
    ),
    (
        'fitting.fit(scene, friction, {"lower.spectrum.hurst": fitting.Positive()})',
        "no part of the scene has a shift",
    ),
)


@pytest.mark.usefixtures("folder")
def test_every_mistake_is_answered_in_one_line():
    names = {}
    for cell, said in MISTAKES:
        answer = entered(cell, names)
        assert (said in answer) if said else answer == "", (cell, answer)
        assert len(re.findall(r"^ValueError: .*", answer, re.M)) <= 1
        assert not answer.startswith("ValueError") or "\n" not in answer, answer


def test_a_scene_is_no_job_and_a_job_no_scene(call_main):
    status, printed, complaint = call_main(fit_main, DATA / "tread_on_asphalt.toml")
    assert (status, printed, complaint.count("\n")) == (2, "", 1)
    assert "is a scene file, for `rubberfric run`" in complaint
    status, printed, complaint = call_main(scene_main, "run", DATA / "tread_on_asphalt_fit.toml")
    assert (status, printed, complaint.count("\n")) == (2, "", 1)
    assert "not a job of `rubberfric-fit`" in complaint
