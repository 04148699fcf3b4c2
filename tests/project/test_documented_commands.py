"""Every command line of the pages with files of the project runs, and gives right results.

`tests/fitting/commands/test_laboratory_commands.py` runs the commands in data/laboratory, and
`tests/fitting/commands/test_options_of_commands.py` the options of their --help.
"""

import math
import re
import shlex
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.special import erf
from support.folders import ROOT

import fitting
import rubberfric as rf
from fitting.commands.main import main as fit_main
from rubberfric.commands.main import main as scene_main

PAGES = [ROOT / "README.md", ROOT / "data" / "README.md", *sorted((ROOT / "notebooks").glob("*.md"))]
# Behind four spaces, a backtick or the beginning of a line.
LINE = re.compile(r"(?:^    .*?|`|^)((?:rubberfric|rubberfric-fit) [^`\n]*data/[^`\n]*)", re.M)
COMMANDS = [
    line.strip()
    for page in PAGES
    if page.name != "measured.md"
    for line in LINE.findall(page.read_text(encoding="utf-8"))
]
LONG = ("rubberfric accuracy",)  # half a minute and more
# Waits for a browser: tests/rubberfric/commands/explorer.
SERVING = ("rubberfric explore",)


def test_all_pages_are_searched():
    assert len(COMMANDS) >= 7
    assert {line.split()[0] for line in COMMANDS} == {"rubberfric", "rubberfric-fit"}


@pytest.mark.usefixtures("in_a_copy")
@pytest.mark.parametrize(
    "command",
    [
        pytest.param(c, marks=[pytest.mark.slow] * c.startswith(LONG))
        for c in dict.fromkeys(COMMANDS)
        if not c.startswith(SERVING)
    ],
)
def test_commands(command, call_main):
    program, *arguments = shlex.split(command)
    main = {"rubberfric": scene_main, "rubberfric-fit": fit_main}[program]
    status, printed, complaint = call_main(main, *arguments)
    assert status == 0, complaint
    assert printed
    for name in arguments:
        if name.endswith((".png", ".h5")):
            assert Path(name).stat().st_size > 1000
    if arguments[0] == "run":
        check_run(printed)
    if "--out" in arguments:
        check_file(arguments[0], arguments[arguments.index("--out") + 1])


def check_run(printed):
    """Compare printed lines with a sum over wavevectors and directions."""
    rows = [line.split() for line in printed.splitlines() if re.match(r"\s+\d\.\d+e", line)]
    assert len(rows) == 41
    for v, area, mu, *_ in (map(float, rows[k]) for k in (5, 20, 30, 35)):
        expected = tread(v, 0.15e6)
        assert area == pytest.approx(expected[0], rel=2e-4)
        assert mu == pytest.approx(expected[1], rel=2e-4)


def check_file(command, path):
    if command.endswith(".toml"):
        assert fitting.FitResult.load(path).verdict.explains
        return
    if command == "cards":
        rubber = tomllib.loads((ROOT / "data" / "tread_on_asphalt.toml").read_text())["upper"]["material"]
        s = 1j * 1e3 * np.array(rubber["tau"])
        exact = rubber["E_inf"] + np.sum(np.array(rubber["E"]) * s / (1 + s))
        found = rf.complex_modulus(rf.io.read_prony(path, unit_stress="MPa"), 1e3, 293.15)
        assert complex(found) == pytest.approx(exact, rel=1e-9)
        return
    result = rf.io.load_result(path)
    v, p, T = result.conditions
    i = int(np.argmin(np.abs(T - 293.15)))
    for j, k in ((0, v.size // 2), (p.size - 1, v.size - 10)):
        shift = 10 ** (-12.0 * (T[i] - 293.15) / (150.0 + T[i] - 293.15))
        found = result.solution.area[i, j, k], result.solution.friction[i, j, k]
        assert found == pytest.approx(tread(v[k] * shift, p[j]), rel=2e-4)


def tread(v, sigma):
    """Return A/A0 and mu of data/tread_on_asphalt.toml at its reference temperature, after eqs. (A6), (A17).

    The integrals over q and phi are sums of midpoints.
    """
    scene = tomllib.loads((ROOT / "data" / "tread_on_asphalt.toml").read_text())
    road, rubber = scene["lower"]["spectrum"], scene["upper"]["material"]
    q0, qr, q1, H = (road[name] for name in ("q0", "qr", "q1", "hurst"))
    borders = np.concatenate([np.geomspace(q0, qr, 201)[:-1], np.geomspace(qr, q1, 401)])
    q, dq = np.sqrt(borders[1:] * borders[:-1]), np.diff(np.log(borders))
    C = np.minimum(1.0, (q / qr) ** (-2 * (1 + H)))
    C *= road["h_rms"] ** 2 / (2 * math.pi * (q**2 * C * dq).sum())
    phi = (np.arange(200) + 0.5) * (math.pi / 2) / 200
    omega, E = q[:, None] * v * np.cos(phi), rubber["E_inf"]
    for modulus, tau in zip(rubber["E"], rubber["tau"], strict=True):
        E = E + modulus * 1j * omega * tau / (1 + 1j * omega * tau)
    K = E / ((1 - rubber["poisson"] ** 2) * sigma)
    # The mean over a quarter of the circle is the mean over the circle.
    steps = 2 * math.pi / 8 * q**4 * C * (np.abs(K) ** 2).mean(1) * dq
    P = erf(0.5 / np.sqrt(np.cumsum(steps) - steps / 2))
    S = 0.5 + 0.5 * P**2
    mu = 0.5 * (q**4 * C * S * P * 2 * math.pi * (np.cos(phi) * K.imag).mean(1) * dq).sum()
    return float(erf(0.5 / np.sqrt(steps.sum()))), float(mu)
