"""A solid through Prony, through its series alone, and through its modulus alone."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from problems import ROAD, TREAD, WLF, WORN

import rubberfric as rf
from rubberfric.base import NONNEGATIVE, POSITIVE, Number, Vector, child, forget, leaf, physical
from rubberfric.materials.material import Material, Series, plane_strain_factor
from rubberfric.materials.shifts import Shift

GROOVES = rf.Anisotropic(ROAD, 2.0, 0.4, 4)
TURNING = rf.TabulatedAnisotropic(
    [200.0, 2e3, 2e4], np.array([[4e-11], [1e-12], [1e-15]]) * (1 + np.array([0.0, 0.2, 0.5, 0.1, 0.3])), 0.3
)
SOFTENING = rf.Softening([1e-3, 0.1, 0.5, 1.5], [1.0, 0.7, 0.4, 0.3], [1.0, 0.9, 0.6, 0.5], 0.3)
HEATING = rf.Heating(1.2e3, 1.6e3, 0.23, 2e-3, 0.05)
STEEL = rf.Rigid()
GLASS = rf.Elastic(5e7, 0.3)
SLAB = rf.Slab(2e-3)


def by_series():
    class AnsweredBySeries(Material):
        """Known by `reduced_series` alone."""

        E_inf: Number = leaf(NONNEGATIVE, unit="Pa")
        E: Vector = leaf(NONNEGATIVE, unit="Pa")
        tau: Vector = leaf(POSITIVE, unit="s")
        poisson: Number = leaf(NONNEGATIVE, unit="-")
        shift: Shift | None = child(default=None)

        def reduced_series(self, scale):
            unit = plane_strain_factor(self) / scale
            return Series(self.E_inf * unit, self.E * unit, self.tau)

    return AnsweredBySeries


def by_modulus():
    class AnsweredByModulus(Material):
        """Known by `modulus` and `frequency_range` alone."""

        E_inf: Number = leaf(NONNEGATIVE, unit="Pa")
        E: Vector = leaf(NONNEGATIVE, unit="Pa")
        tau: Vector = leaf(POSITIVE, unit="s")
        poisson: Number = leaf(NONNEGATIVE, unit="-")
        shift: Shift | None = child(default=None)

        def frequency_range(self):
            return 1 / jnp.max(self.tau), 1 / jnp.min(self.tau)

        def modulus(self, omega):
            a = 1j * omega[..., None] * self.tau
            return self.E_inf + jnp.sum(self.E * a / (1 + a), -1)

        def static_modulus(self):
            return self.E_inf

    return AnsweredByModulus


def scene(lower, upper, **options):
    return rf.Scene(rf.Body(*lower), rf.Body(*upper), **options)


# Every way in which a solid that relaxes stands in a scene; the solid is their argument.
SCENES = {
    "rigid road": lambda solid: scene((STEEL, ROAD), (solid,)),
    "both rough": lambda solid: scene((STEEL, ROAD), (solid, WORN), area_correction=True),
    "on elastic": lambda solid: scene((GLASS, ROAD), (solid,)),
    "slab": lambda solid: scene((STEEL, ROAD), (solid, None, SLAB)),
    "coating": lambda solid: scene((STEEL, ROAD), (solid, None, rf.Coating(1e-3, GLASS))),
    "slab on elastic": lambda solid: scene((GLASS, ROAD), (solid, None, SLAB)),
    "two rubbers": lambda solid: scene((TREAD, ROAD), (solid, WORN)),
    "grooved": lambda solid: scene((STEEL, GROOVES), (solid,)),
    "turning grooves": lambda solid: scene((STEEL, TURNING), (solid,)),
    "softened": lambda solid: scene((STEEL, ROAD), (solid,), softening=SOFTENING),
    "softened on elastic": lambda solid: scene((GLASS, ROAD), (solid,), softening=SOFTENING),
    "heated": lambda solid: scene((STEEL, ROAD), (solid,), heating=HEATING),
}
ORDINARY = ("rigid road", "softened on elastic")
V = np.array([1e-4, 0.3, 20.0])


@pytest.fixture(scope="module")
def solids():
    """Return a solid of three classes; two are registered during these tests."""
    made = [physical(cls()) for cls in (by_series, by_modulus)]
    numbers = {"E_inf": TREAD.E_inf, "E": TREAD.E, "tau": TREAD.tau, "poisson": 0.45, "shift": WLF}
    yield [cls(**numbers) for cls in (rf.Prony, *made)]
    for cls in made:
        forget(cls)


@functools.partial(jax.jit, static_argnames=("names",))
def solve(scene, names):
    found = rf.solve(scene, V, 2e5, 300.0, quantities=names)
    return jnp.stack([getattr(found, name) for name in names])


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (n not in ORDINARY)) for n in SCENES]
)
def test_equal_answers_make_equal_solids(name, solids):
    prony, series, modulus = map(SCENES[name], solids)
    names = tuple(n for n in rf.quantities_of(prony) if n != "converged")
    assert rf.quantities_of(modulus) == rf.quantities_of(prony)
    exact = solve(prony, names)
    np.testing.assert_allclose(solve(series, names), exact, rtol=1e-12)
    # By quadrature over the angle, and over ln(q v) by interpolation.
    np.testing.assert_allclose(solve(modulus, names), exact, rtol=1e-9, atol=1e-12 * abs(exact[1]).max())
