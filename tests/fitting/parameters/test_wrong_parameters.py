"""Free parameters that are refused, each with one line."""

import numpy as np
import pytest
from support.refusals import one_line
from support.scenes.fits import E_INF, FOUR_WARM, Q1, E

from fitting import Bounded, Free, Positive, RmsSlope, Tied
from fitting.parameters.variables import free_parameters
from rubberfric.scene.scene import cast

SCENE = cast(FOUR_WARM, np.float64)
QR = "lower.spectrum.qr"


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("upper.material.e", "unknown key path; did you mean 'upper.material.E'?"),
        ("lower.spectrum.hurt", "did you mean 'lower.spectrum.hurst'?"),
        ("lower.material.E", "did you mean 'upper.material.E'?"),
        ("gama", "did you mean 'gamma'?"),
        ("E", "unknown key path; must be one of lower.spectrum.q0, "),
        ("upper.material.E.x", "unknown key path"),
        ("area_correction", "is a static field"),
        ("upper.material", "is an object; must be one of its numbers: upper.material.E_inf"),
        ("upper", "is an object"),
        ("shear.tau_f0", "the scene has no shear; add one before the fit"),
        ("shear", "the scene has no shear"),
        ("upper.spectrum.hurst", "the scene has no spectrum"),
        ("upper.layer.thickness", "the scene has no layer"),
        ("heating", "the scene has no heating"),
        ("gamma[0]", "gamma is a single number; leave [ ] out"),
        (E + "[4]", "has the elements [0] ... [3]; must name one of them"),
        (E + "[-5]", "has the elements [0] ... [3]"),
        (E + "[2:2]", "has the elements [0] ... [3]"),
        (E + "[3:1]", "has the elements [0] ... [3]"),
        (E + "[]", "has the elements [0] ... [3]"),
        (E + "[1 2]", "has the elements [0] ... [3]"),
        (E + "[-]", "must be a key path like"),
    ],
)
def test_wrong_paths(path, text):
    message = one_line(lambda: free_parameters(SCENE, {path: Positive()}))
    assert message.startswith(f"{path!r}: ") and text in message


@pytest.mark.parametrize(
    ("free", "text"),
    [
        # starts that the rule does not allow
        ({E: Positive(0.0)}, "starts at 0: must start at a value > 0, because it is Positive; give start="),
        ({E: Positive(-1.0)}, "starts at -1: must start at a value > 0, because it is Positive"),
        ({E: Positive([1.0, 2.0, -3.0, 4.0])}, "starts at -3"),
        ({E: Positive([1.0, 2.0])}, "start = [1.0, 2.0]: must be one number or 4 numbers"),
        ({E: Positive(np.nan)}, "start = nan: must be finite"),
        ({E: Free([1.0, np.inf, 1.0, 1.0])}, "must be finite"),
        (
            {E: Bounded(0.0, 1e6)},
            "starts at 5e+08: must start inside the bounds 0 ... 1e+06, not on them; give",
        ),
        ({E: Bounded(2e6, 1e9)}, "starts at 2e+06: must start inside the bounds"),
        ({E: Bounded(0.0, 1.0, start=1.0)}, "starts at 1: must start inside the bounds 0 ... 1, not on them"),
        ({E: Bounded(0.0, 1.0, start=0.0)}, "starts at 0: must start inside the bounds"),
        # sets of free parameters
        ([E], "free: must be a dict of key paths"),
        ({E: Positive}, "must be Positive, Bounded, Free, Tied or RmsSlope"),
        ({E: Positive(), E + "[2]": Free()}, f"free['{E}[2]']: already free as '{E}'"),
        ({E + "[1:3]": Positive(), E + "[-2:]": Free()}, f"already free as '{E}[1:3]'"),
        ({E + "[3]": Positive(), E + "[-1]": Tied("gamma"), "gamma": Positive()}, "already free"),
        # ties
        ({E: Tied("gamma")}, "all parameters are Tied or RmsSlope; at least one must be free itself"),
        ({Q1: RmsSlope(0.2)}, "all parameters are Tied or RmsSlope; at least one must be free itself"),
        ({E: Tied(E + "[0]"), "gamma": Positive()}, "must be another key of free, one that is not tied"),
        ({E: Tied(E), "gamma": Positive()}, "must be another key of free, one that is not tied itself"),
        ({E: Tied(3), "gamma": Positive()}, "tied to 3: must be another key of free"),
        ({E: Positive(), "gamma": Tied(E + "[:]")}, "must be another key of free"),
        ({E: Positive(), "gamma": Tied(E)}, f"has 1 elements, but '{E}' has 4; tie it to a parameter"),
        ({E + "[:3]": Tied(E + "[3:]"), E + "[3:]": Free(start=0.0)}, "starts at 0, so the ratio must be"),
        ({"gamma": Positive(), E: Tied(E_INF), E_INF: Tied("gamma")}, "one that is not tied itself"),
        ({Q1: RmsSlope(1.0), "gamma": Tied(Q1), E: Free()}, "must be another key of free, one that is not"),
        # rules of cut-offs
        ({QR: RmsSlope(1.0), E: Free()}, f"free['{QR}']: RmsSlope is for the q1 of a spectrum"),
        ({E_INF: RmsSlope(1.0), E: Free()}, "RmsSlope is for the q1 of a spectrum; must end in .q1"),
        # q0 <= qr <= q1
        ({Q1: Positive(500.0)}, f"{Q1} starts at 500, below {QR} at 1000: the first must be >= the second"),
        ({QR: Positive(), Q1: Tied(QR, 0.5)}, f"{Q1} starts at 500, below {QR} at 1000"),
    ],
)
def test_wrong_sets_of_rules(free, text):
    assert text in one_line(lambda: free_parameters(SCENE, free))


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Bounded(1.0, 0.3), "Bounded(1.0, 0.3): must be finite numbers, low < high"),
        (lambda: Bounded(0.3, 0.3), "low < high"),
        (lambda: Bounded(0.0, np.inf), "must be finite"),
        (lambda: Bounded(np.nan, 1.0), "must be finite"),
        (lambda: Bounded("0", 1.0), "must be finite numbers"),
        (lambda: Bounded(np.zeros(2), 1.0), "must be finite numbers"),
        (lambda: Free(scale=0.0), "scale = 0.0: must be a number > 0"),
        (lambda: Free(scale=np.inf), "must be a number > 0"),
        (lambda: Free(scale="big"), "must be a number > 0"),
        (lambda: Tied("gamma", ratio=np.nan), "ratio = nan: must be a finite number"),
        (lambda: Tied("gamma", ratio="half"), "must be a finite number"),
        *((lambda s=s: RmsSlope(s), "RmsSlope: slope =") for s in (0.0, -1.0, np.nan, "steep")),
    ],
)
def test_wrong_rules(make, text):
    assert text in one_line(make)
