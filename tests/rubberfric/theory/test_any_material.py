"""A solid through Prony, through its series alone, and through its modulus alone."""

import jax.numpy as jnp
import numpy as np
import pytest
from problems import having

import rubberfric as rf
from rubberfric.base import NONNEGATIVE, POSITIVE, Number, Vector, child, forget, leaf, physical
from rubberfric.base.objects.physical import parts_of
from rubberfric.materials.material import Material, Series, plane_strain_factor
from rubberfric.materials.shifts import Shift


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


NUMBERS = ("E_inf", "E", "tau", "poisson", "shift")
OF_PRONY = {one.name: one for one in having("prony", without=("liquid",))}


@pytest.fixture(scope="module")
def classes():
    """Return two classes of solids that are registered during these tests."""
    made = [physical(cls()) for cls in (by_series, by_modulus)]
    yield made
    for cls in made:
        forget(cls)


@pytest.mark.slow
@pytest.mark.parametrize("name", OF_PRONY)
def test_equal_answers_make_equal_solids(name, classes):
    problem = OF_PRONY[name]
    solids = {path: part for path, part in parts_of(problem.scene) if isinstance(part, rf.Prony)}
    exact = problem.solved()
    # By quadrature over the angle, and over ln(q v) by interpolation.
    for cls, rtol in zip(classes, (1e-12, 1e-9), strict=True):
        numbers = {path: {key: getattr(part, key) for key in NUMBERS} for path, part in solids.items()}
        scene = problem.scene.replace({path: cls(**values) for path, values in numbers.items()})
        assert rf.quantities_of(scene) == rf.quantities_of(problem.scene)
        found = problem.solved(scene=scene)
        for quantity in problem.names:
            floor = 1e-3 * abs(exact["friction"][0]) * quantity.endswith("friction")
            np.testing.assert_allclose(
                found[quantity], exact[quantity], rtol=rtol, atol=rtol * floor, err_msg=quantity
            )
