"""Measured compounds as a laboratory has them, all in tables: fits of the contact shear and of the cut-off.

Modulus, shift and road are tables; free are the law of contact shear and where the roughness ends. Six
points per compound, without error bars, so fits of them prove nothing. The tests assert that fits end, that
one law serves both compounds, and how well one compound predicts the other; `-s` prints the table.
The data lie outside the project.
"""

import functools

import numpy as np
import pytest
from support.counting.compilations import compilations
from support.published import needs
from support.scenes.tyre import GAMMA, PRESSURE, read, road, rubber

import fitting
import rubberfric as rf
from fitting import FrictionData, Positive

pytestmark = [needs("tyre"), pytest.mark.slow]

T = 293.15
COMPOUNDS = ("R20", "R40")
Q1 = "upper.spectrum.q1"
SHEAR = ("shear.tau_f0", "shear.c", "shear.v0")
FREE = {name: Positive() for name in (*SHEAR, Q1)}
SHARED = {f"*.{name}": rule for name, rule in FREE.items()}


def scene(compound, hot, v0=6e-3):
    return rf.Scene(
        rf.Body(rubber(compound, shifted=True)),
        rf.Body(rf.Rigid(), road()),
        gamma=GAMMA,
        area_correction=True,
        shear=rf.ContactShear(6.5e6, 0.1, v0),
        heating=rf.Heating(1200.0, 1600.0, 0.23, 2e-3) if hot else None,
    )


def measured(compound):
    columns = read(f"measured_friction_{compound}.csv")
    return FrictionData(*columns, pressure=PRESSURE, temperature=T, name=compound)


@functools.cache
def fitted(compound, hot):
    return fitting.fit(scene(compound, hot), measured(compound), FREE)


@functools.cache
def joint(hot):
    scenes, data = ({c: of(c) for c in COMPOUNDS} for of in (lambda c: scene(c, hot), measured))
    return fitting.fit(scenes, data, SHARED)


def rms(predicted, compound):
    return float(np.sqrt(np.mean(np.log(np.asarray(predicted) / measured(compound).friction) ** 2)))


@pytest.mark.parametrize("hot", [False, True], ids=["cold", "hot"])
@pytest.mark.parametrize("compound", COMPOUNDS)
def test_every_fit_ends_at_a_minimum_that_other_starts_reach(compound, hot):
    found = fitted(compound, hot)
    assert found.success, found.message
    again = fitting.fit(scene(compound, hot, v0=1e-3), measured(compound), FREE)
    assert again.success
    np.testing.assert_allclose(again.estimated, found.estimated, rtol=1e-4)
    assert found.estimated[0] < 0.25


@pytest.mark.parametrize("hot", [False, True], ids=["cold", "hot"])
def test_one_law_of_shear_for_both(hot):
    found = joint(hot)
    assert found.success and len(found.names) == 4
    print("\n" + found.report())
    for compound in COMPOUNDS:
        own = rms(found.predict(measured(compound).velocity, PRESSURE, T, scene=compound), compound)
        alone = rms(fitted(compound, hot).predict(measured(compound).velocity, PRESSURE, T), compound)
        assert own > alone - 1e-6, "a fit of one alone is closer to it"
        assert own < 0.25


def blind(hot):
    """rms of ln(predicted / measured) of either compound, from the fit of the other."""
    found = {}
    for compound, other in (COMPOUNDS, COMPOUNDS[::-1]):
        known = fitted(other, hot).scene
        there = scene(compound, hot).replace({"shear": known.shear, Q1: known.upper.spectrum.q1})
        found[compound] = rms(rf.friction(there, measured(compound).velocity, PRESSURE, T), compound)
    return found


def baselines():
    """The error of the other's measured curve, and of a parabola through its logarithms."""
    curve, parabola = {}, {}
    for compound, other in (COMPOUNDS, COMPOUNDS[::-1]):
        curve[compound] = rms(measured(other).friction, compound)
        law = np.polyfit(np.log(measured(other).velocity), np.log(measured(other).friction), 2)
        parabola[compound] = rms(np.exp(np.polyval(law, np.log(measured(compound).velocity))), compound)
    return {"the other's curve": curve, "a parabola of it": parabola}


def test_blind_predictions_beside_two_baselines():
    rows = {"scene, cold": blind(False), "scene, hot": blind(True)} | baselines()
    print(f"\n{'predicted by':20s}" + "".join(f"{c:>8s}" for c in COMPOUNDS))
    for name, found in rows.items():
        print(f"{name:20s}" + "".join(f"{100 * found[c]:7.1f}%" for c in COMPOUNDS))
    for compound in COMPOUNDS:
        assert rows["the other's curve"][compound] == pytest.approx(0.092, abs=0.001)
        assert rows["scene, cold"][compound] < 0.35 and rows["scene, hot"][compound] < 0.35


@pytest.mark.parametrize("hot", [False, True], ids=["cold", "hot"])
def test_a_second_fit_compiles_nothing(hot):
    with compilations() as compiled:
        fitting.fit(scene("R20", hot), measured("R20"), FREE)
        assert compiled
        compiled.clear()
        fitting.fit(scene("R20", hot, v0=1e-3), measured("R20"), FREE)
    assert not compiled
