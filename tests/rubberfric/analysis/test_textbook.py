"""The textbook method converges to the library's values, for everything a scene can hold."""

import dataclasses

import numpy as np
import pytest
from support.counting.timing import in_turns
from support.scenes import curves
from support.scenes.common import RIGID, ROAD, SHEAR, scene
from support.scenes.common import SHIFTED_TREAD as TREAD

import rubberfric as rf
from rubberfric.analysis import textbook
from rubberfric.analysis.textbook import modulus_at, range_of, spectrum_at

TRACK = rf.Prony(2e6, [2e8, 2e7], [1e-6, 1e-4], 0.49, rf.Arrhenius(1.0, 293.15))
TABLE = rf.TabulatedModulus(
    np.logspace(0, 6, 7),
    np.geomspace(3e6, 3e8, 7),
    np.geomspace(1e5, 1e8, 7),
    shift=rf.TabulatedShift([273.15, 293.15, 313.15], [30.0, 1.0, 0.1], 293.15),
)
# Ranges of three decades in common, a spectrum ending after a fifth or two thirds of them: at a node
# of every grid here. An end between nodes would add an error of up to one step.
FLOOR = rf.SelfAffine(100.0, 1000.0, 1e4, 0.8, 5e-4)
WORN = rf.SelfAffine(10**2.6, 2000.0, 1e5, 0.7, 5e-5)
PLATE = rf.TabulatedSpectrum(np.geomspace(100.0, 3.1e4, 6), np.geomspace(1e-13, 1e-19, 6))
STEEL = rf.Elastic(1e8, 0.3)


SCENES = {
    "smooth rubber": scene((RIGID, ROAD), (TREAD,)),
    "flat spectrum": scene((RIGID, dataclasses.replace(ROAD, hurst=0.0)), (TREAD,)),
    "sheared": scene((RIGID, ROAD), (TREAD,), shear=SHEAR),
    "corrected": scene((RIGID, ROAD), (TREAD,), gamma=0.6, area_correction=True),
    "two rubbers": scene((TRACK, WORN), (TREAD, FLOOR)),
    "layer": scene((RIGID, ROAD), (TREAD, None, rf.Slab(1e-3))),
    "layers": scene((STEEL, PLATE, rf.Slab(1e-3, "frictionless")), (TREAD, ROAD, rf.Slab(2e-3))),
    "tabulated": scene((RIGID, PLATE), (TABLE,)),
    "elastic": scene((STEEL, ROAD), (rf.Elastic(1e7, 0.5),)),
    "smooth": scene((RIGID,), (TREAD,), shear=SHEAR),
}
VELOCITY, PRESSURE = np.array([-1e-2, 1e-4, 1e-1]), np.array([[1.5e5], [1e7]])


def errors(scene, temperature, nodes, pressure=PRESSURE, velocity=VELOCITY):
    """Relative errors, (quantities, pressures, velocities)."""
    found = textbook.textbook_solve(scene, velocity, pressure, temperature, nodes=nodes)
    exact = rf.solve(scene, velocity, pressure, temperature)
    exact = {name: np.asarray(getattr(exact, name)) for name in found}
    assert all(found[name].shape == exact[name].shape for name in found)
    scale = {name: np.where(exact[name] == 0, 1.0, np.abs(exact[name])) for name in found}
    # In full contact the separation is 1e-30 of the roughness and less, and 0 for the textbook method.
    rough = [body.spectrum for body in (scene.lower, scene.upper) if body.spectrum is not None]
    scale["separation"] += 1e-6 * sum(float(rf.roughness.moment(spectrum, 0)) for spectrum in rough) ** 0.5
    return np.stack([np.abs(found[name] - exact[name]) / scale[name] for name in found])


@pytest.mark.parametrize("name", SCENES)
def test_converges_to_the_values_of_the_library(name):
    shifted = name not in ("elastic",)
    at = SCENES[name], 283.15 if shifted else None
    coarse, fine = errors(*at, (76, 30)), errors(*at, (301, 120))
    assert np.max(fine) < 0.025
    # Four times the nodes: at least half the error, for P falls like (q - q0)^(-1/2) at once where
    # the load is light or the layer is stiff; everywhere else a quarter and less.
    assert np.all(np.max(fine, (1, 2)) <= 0.5 * np.max(coarse, (1, 2)) + 1e-12)


@pytest.mark.parametrize("outside", ["fall", "hold", "none"])
def test_modulus_outside_its_table(outside):
    material = dataclasses.replace(TABLE, outside=outside)
    omega = np.logspace(-4, 9, 27)
    found = modulus_at(material, omega[None, None], np.array([280.0]))[0, 0]
    np.testing.assert_allclose(found, rf.complex_modulus(material, omega, 280.0), rtol=1e-12)
    mirrored = modulus_at(material, -omega[None, None], np.array([280.0]))[0, 0]
    np.testing.assert_allclose(mirrored, found.conj(), rtol=1e-15)


def test_second_order_in_the_wavevector():
    """Full contact at first, every angle resolved, a node at the kink: the trapezoids' own order."""
    road = rf.SelfAffine(100.0, 1000.0, 1e4, 0.8, 5e-4)
    slow = scene((RIGID, road), (rf.Prony(3e6, [4e8, 5e7], [1e-7, 1e-3]),))
    at = {"pressure": np.array([4e6]), "velocity": np.array([1e-7])}
    one, two, four = (errors(slow, None, (n, n), **at)[:, 0] for n in (101, 201, 401))
    for coarse, fine in ((one, two), (two, four)):
        assert np.all((coarse / fine > 3.5) & (coarse / fine < 4.5)), (coarse, fine)


def test_quantities_alone_and_points_in_blocks(monkeypatch):
    at = (SCENES["sheared"], VELOCITY, PRESSURE, 283.15)
    whole = textbook.textbook_solve(*at, nodes=(40, 16))
    monkeypatch.setattr(textbook, "_AT_ONCE", 2 * 40 * 16)
    for name in whole:
        (alone,) = textbook.textbook_solve(*at, nodes=(40, 16), quantities=(name,)).items()
        assert alone[0] == name
        np.testing.assert_allclose(alone[1], whole[name], rtol=1e-13)


@pytest.mark.benchmark
def test_as_fast_as_trapezoids_written_for_one_scene():
    times = in_turns(
        {
            "numpy": curves.numpy_friction,
            "textbook": lambda: textbook.textbook_solve(
                curves.ONE, curves.VELOCITY, curves.PRESSURE, quantities=("friction",)
            ),
        },
        rounds=15,
    )
    print(f"\ntextbook / NumPy for one scene: {times['textbook'] / times['numpy']:.2f}")
    assert times["textbook"] < 1.5 * times["numpy"]


@pytest.mark.parametrize(
    "part",
    [
        {"heating": rf.Heating(1200.0, 1600.0, 0.23, 2e-3)},
        {"softening": rf.Softening(np.array([1e-3, 1.0]), np.array([1.0, 0.3]), np.array([1.0, 0.5]))},
        {"lower": rf.Body(RIGID, rf.Anisotropic(ROAD, 2.0))},
    ],
    ids=lambda part: next(iter(part)),
)
def test_what_it_does_not_cover_is_refused(part):
    plain = scene((RIGID, ROAD), (TREAD,))
    other = dataclasses.replace(plain, **part)
    assert textbook.covers(plain) and not textbook.covers(other)
    with pytest.raises(
        ValueError, match="scene: heating, softening, adhesion, correlation and anisotropy must be absent"
    ):
        textbook.textbook_solve(other, 1.0, 1e5, 293.15)


def test_a_table_with_ends_of_its_own():
    """C(q) between q0 and q1 only, as the library has it."""
    cut = dataclasses.replace(PLATE, q0=150.0, q1=2e4)
    assert range_of(cut) == (150.0, 2e4) and range_of(PLATE) == (100.0, float(PLATE.q[-1]))
    q = np.array([100.0, 149.0, 150.0, 3e3, 2e4, 2.1e4, 3e4])
    np.testing.assert_allclose(spectrum_at(cut, q), rf.power_spectrum(cut, q), rtol=1e-12)
