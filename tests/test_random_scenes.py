"""Random scenes drawn far beyond what is physical: finite, in bounds, with finite gradients.

Ranges: tau over 40 decades, zero and equal terms, liquids, q1/q0 = 1.001 ... 1e10 with the
roll-off anywhere, H = 0 ... 1, layers of 1e-9 ... 10 m, v = 0 and 1e-30 ... 1e12 m/s,
pressures of 1e-6 ... 1e12 Pa.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from cases import three

import rubberfric as rf

TERMS = 8


def rubber(rng):
    centre, span = rng.uniform(-10, 5), rng.choice([2, 10, 40])
    tau = 10 ** (centre + rng.uniform(-span / 2, span / 2, TERMS))
    E = 10 ** rng.uniform(2, 10, TERMS)
    if rng.random() < 0.3:
        E[rng.integers(0, TERMS, 3)] = 0.0
    if rng.random() < 0.3:
        tau[3:6] = tau[2]
    if rng.random() < 0.1:
        E[:] = 0.0
    E_inf = 0.0 if rng.random() < 0.2 and E.any() else 10 ** rng.uniform(3, 8)
    return rf.Prony(E_inf, E, tau, rng.choice([0.0, 0.3, 0.5]))


def roughness(rng):
    q0, width = 10 ** rng.uniform(0, 6), rng.choice([1.001, 3.0, 1e3, 1e6, 1e10])
    qr = np.clip(q0 * width ** rng.choice([0.0, 1.0, rng.random()]), q0, q0 * width)
    h_rms = 0.0 if rng.random() < 0.1 else 10 ** rng.uniform(-9, -3)
    return rf.SelfAffine(q0, qr, q0 * width, rng.choice([0.0, 1e-9, 0.5, 0.8, 1.0]), h_rms)


def slab(rng, base):
    return rf.Slab(10 ** rng.uniform(-9, 1), base)


KINDS = {
    "smooth-on-rigid": lambda r: (rf.Body(rubber(r)), rf.Body(rf.Rigid(), roughness(r))),
    "rough-on-rigid": lambda r: (rf.Body(rubber(r), roughness(r)), rf.Body(rf.Rigid(), roughness(r))),
    "two-rubbers": lambda r: (rf.Body(rubber(r), roughness(r)), rf.Body(rubber(r), roughness(r))),
    "on-elastic": lambda r: (
        rf.Body(rubber(r), roughness(r)),
        rf.Body(rf.Elastic(10 ** r.uniform(0, 12), 0.3), roughness(r)),
    ),
    "slab-on-rigid": lambda r: (
        rf.Body(rubber(r), None, slab(r, "bonded")),
        rf.Body(rf.Rigid(), roughness(r)),
    ),
    "two-slabs": lambda r: (
        rf.Body(rubber(r), roughness(r), slab(r, "frictionless")),
        rf.Body(rubber(r), roughness(r), slab(r, "bonded")),
    ),
}


def draw(kind, corrected, count, seed):
    rng = np.random.default_rng(seed)
    scenes = [
        rf.Scene(*KINDS[kind](rng), gamma=rng.uniform(0, 1), area_correction=corrected) for _ in range(count)
    ]
    batch = jax.tree.map(lambda *leaves: jnp.stack([jnp.asarray(x, float) for x in leaves]), *scenes)
    often = rng.random(count) < 0.5  # half of them at speeds and pressures of daily life
    velocity = np.where(often, 10 ** rng.uniform(-8, 2, count), 10 ** rng.uniform(-30, 12, count))
    velocity[rng.random(count) < 0.05] = 0.0
    pressure = np.where(often, 10 ** rng.uniform(3, 7, count), 10 ** rng.uniform(-6, 12, count))
    return batch, jnp.asarray(velocity), jnp.asarray(pressure)


def check(kind, corrected, count, seed):
    def quantities(scene, velocity, pressure):
        return jnp.stack(three(rf.solve(scene, velocity, pressure)))

    at = draw(kind, corrected, count, seed)
    values = np.asarray(jax.jit(jax.vmap(quantities))(*at))
    assert np.isfinite(values).all()
    assert (values >= 0).all() and (values[:, 0] <= 1).all()
    for path, leaf in jax.tree_util.tree_leaves_with_path(
        jax.jit(jax.vmap(jax.jacrev(quantities, (0, 1, 2))))(*at)
    ):
        assert np.isfinite(leaf).all(), jax.tree_util.keystr(path)


@pytest.mark.parametrize(
    ("kind", "corrected"),
    [("smooth-on-rigid", False), ("rough-on-rigid", True), ("on-elastic", False), ("two-slabs", False)],
)
def test_a_hundred_scenes(kind, corrected):
    check(kind, corrected, 100, seed=0)


@pytest.mark.slow
@pytest.mark.parametrize("corrected", [False, True])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_many_scenes(kind, corrected, seed):
    check(kind, corrected, 300, seed=100 + seed)
