"""Four planned fits: data, free parameters, and priors.

The twin job frees 20 numbers of the scene in data/. The DMA job frees moduli and relaxation times, contact
shear the shear law and the Hurst exponent; friction with discrepancy eight moduli and the height of a drawn
scene, where the theory may be off by as much as `fitting.Discrepancy` says.
"""

import numpy as np
from support.cases.sliding_curves import TERMS, drawn_scene
from support.ensembles import twin
from support.folders import DATA
from support.scenes.fits import FAST, ROAD, SHIFTED, E, modulus_data

import fitting
import rubberfric as rf

# Prior standard deviation over value of the twin's numbers.
PART = 0.1
# Prior standard deviation of the twin's exponent, which is not a scale.
EXPONENT = 0.02


def _job(scene, data, prior, **options):
    """Arguments of `fitting.calibration`: an exponent is bounded, all others are positive."""
    bounded = fitting.Bounded(0.3, 1.0)
    free = {path: bounded if path.endswith("hurst") else fitting.Positive() for path in prior}
    return (scene, data, free, prior), options


def twin_job():
    names = fitting.multi_start(twin.TRUTH, twin.twin(), twin.FREE, 1).names
    values = dict(zip(names, twin.true_values(names), strict=True))
    prior = {
        name: fitting.Gaussian(value, EXPONENT if name.endswith("hurst") else PART * value)
        for name, value in values.items()
    }
    return _job(twin.TRUTH, twin.twin(), prior, quadrature=FAST)


def modulus_job():
    data = modulus_data(SHIFTED, np.geomspace(1e1, 1e6, 24), error=0.0, relative=0.05)
    prior = {"upper.material.E_inf": fitting.Gaussian(3e6, 1e6)}
    prior |= {f"{E}[{k}]": fitting.Gaussian(value, 0.3 * value) for k, value in enumerate([5e7, 8e6])}
    prior |= {f"upper.material.tau[{k}]": fitting.Gaussian(v, 0.3 * v) for k, v in enumerate([1e-5, 1e-3])}
    return _job(rf.Scene(ROAD, rf.Body(SHIFTED)), data, prior)


def shear_job():
    scene = rf.load_scene(DATA / "sheared_tread_on_asphalt.toml")
    v, p = np.tile(np.logspace(-6.5, -0.5, 12), 2), np.repeat([1e5, 4e5], 12)
    data = fitting.FrictionData(v, np.ones(24), pressure=p, temperature=293.15, relative=0.03)
    prior = {
        "lower.spectrum.hurst": fitting.Gaussian(0.8, 0.05),
        "shear.tau_f0": fitting.Gaussian(6.5e6, 1.3e6),
        "shear.c": fitting.Gaussian(0.1, 0.02),
        "shear.v0": fitting.Gaussian(6e-3, 2e-3),
    }
    return _job(scene, data, prior, quadrature=FAST)


def discrepancy_job():
    scene, v, p = drawn_scene(3)
    data = [fitting.FrictionData(v, np.ones(v.size), pressure=one, relative=0.03) for one in p]
    moduli, height = np.asarray(scene.upper.material.E), float(scene.lower.spectrum.h_rms)
    prior = {f"{E}[{k}]": fitting.Gaussian(moduli[k], 0.3 * moduli[k]) for k in range(TERMS)}
    prior["lower.spectrum.h_rms"] = fitting.Gaussian(height, 0.3 * height)
    return _job(scene, data, prior, quadrature=FAST, discrepancy=fitting.Discrepancy(0.5, np.log(10)))


JOBS = {"twin": twin_job, "modulus": modulus_job, "shear": shear_job, "discrepancy": discrepancy_job}
