"""The energy of full contact from moments of the spectra, and the verdict on adhesion."""

import math

import jax
import numpy as np
import pytest
from support.folders import DATA

import rubberfric as rf
from rubberfric.analysis import adhesion_matters, full_contact_energy


def _square_moment(spectrum):
    """The integral of q^2 C(q) dq."""
    return float(rf.roughness.moment(spectrum, 1)) / (2 * math.pi)


ROUGH = rf.SelfAffine(q0=1e4, qr=3e4, q1=1e7, hurst=0.7, h_rms=2e-7)


def test_energies():
    scene = rf.Scene(rf.Body(rf.Rigid(), ROUGH), rf.Body(rf.Elastic(2e6, 0.4)))
    expected = math.pi / 2 * 2e6 / (1 - 0.4**2) * _square_moment(ROUGH)
    assert float(full_contact_energy(scene)) == pytest.approx(expected, rel=1e-10)
    other = rf.SelfAffine(q0=2e4, qr=5e4, q1=3e6, hurst=0.6, h_rms=1e-7)
    scene = rf.Scene(rf.Body(rf.Elastic(2e6, 0.4), ROUGH), rf.Body(rf.Elastic(5e6, 0.3), other))
    stiffness = 1 / ((1 - 0.4**2) / 2e6 + (1 - 0.3**2) / 5e6)
    expected = math.pi / 2 * stiffness * (_square_moment(ROUGH) + _square_moment(other))
    assert float(full_contact_energy(scene)) == pytest.approx(expected, rel=1e-10)
    scene = rf.Scene(rf.Body(rf.Rigid(), ROUGH), rf.Body(rf.Elastic(2e6, 0.4)))
    slope = jax.jit(jax.grad(full_contact_energy))(scene)
    assert float(slope.upper.material.young) * 2e6 == pytest.approx(
        float(full_contact_energy(scene)), rel=1e-12
    )


def test_adhesion_does_not_matter_on_a_road():
    scene = rf.load_scene(DATA / "tread_on_asphalt.toml")
    found = adhesion_matters(scene, temperature=293.15)
    expected = math.pi / 2 * 3.6e6 / 0.75 * _square_moment(scene.lower.spectrum) / 0.05
    assert float(found.ratio) == pytest.approx(expected, rel=1e-9)
    assert 9e3 < float(found.ratio) < 1e4
    assert str(found).startswith("adhesion does not matter: full contact would store 480 J")
    sliding = adhesion_matters(scene, [1.0, 10.0], 293.15)
    assert np.all(np.asarray(sliding.ratio) > 3 * expected)


@pytest.mark.parametrize(
    ("young", "h_rms", "words"), [(1e7, 2e-7, "adhesion matters"), (2e6, 5e-9, "adhesion is everything")]
)
def test_adhesion_matters_for_a_seal_and_for_silicone_on_glass(young, h_rms, words):
    rough = rf.Body(rf.Rigid(), ROUGH.replace(h_rms=h_rms))
    assert str(adhesion_matters(rf.Scene(rough, rf.Body(rf.Elastic(young, 0.5))))).startswith(words)


def test_smooth_solids_store_nothing_and_wrong_calls_are_refused():
    smooth = rf.Scene(rf.Body(rf.Rigid()), rf.Body(rf.Elastic(2e6, 0.4)))
    assert full_contact_energy(smooth, [0.0, 1.0]).tolist() == [0.0, 0.0]
    with pytest.raises(ValueError, match=r"work = 0.0: must be > 0"):
        adhesion_matters(smooth, work=0.0)
    with pytest.raises(ValueError, match="within jit"):
        jax.jit(adhesion_matters)(smooth)
