"""The scenes of reference/part_cases.json in the library, and their comparison with the values there."""

import jax
import jax.numpy as jnp
import numpy as np
from support.cases.stored import arguments, reference

import rubberfric as rf

QUANTITIES = ("area", "friction", "separation", "transverse_friction")
CASES = reference("part_cases")


def quantities(arguments):
    """Return area, friction, separation and transverse friction in one array."""
    found = rf.solve(*arguments, quantities=QUANTITIES)
    return jnp.stack([getattr(found, name) for name in QUANTITIES])


value = jax.jit(quantities)
forward = jax.jit(jax.jacfwd(quantities))
reverse = jax.jit(jax.jacrev(quantities))


def expected(given):
    """The four quantities of a case, or their derivatives; isotropic roughness has no transverse friction."""
    return np.array([given.get(name, 0.0) for name in ("area", "friction", "separation", "transverse")])


def assert_scene(name, rtol):
    found, exact = value(arguments(CASES[name])), expected(CASES[name])
    # A transverse friction that vanishes by symmetry does so to rounding of the friction.
    np.testing.assert_allclose(found, exact, rtol=rtol, atol=1e-13 * abs(exact[1]))


def assert_modes_agree(name, rtol=1e-9):
    """Jacobian by reverse mode, after comparing it with forward mode."""
    at = arguments(CASES[name])
    Q, one, other = value(at), reverse(at), forward(at)
    for a, b, x in zip(*map(jax.tree.leaves, (one, other, at)), strict=True):
        unit = np.where(np.asarray(x) != 0, np.abs(x), 1.0)
        scale = np.abs(Q).reshape(4, *(1,) * np.ndim(x))
        error = np.abs(np.asarray(a) - np.asarray(b)) * unit
        assert (error <= rtol * (scale + np.abs(a * unit))).all()
    return one


BODIES = {"1": "lower", "2": "upper"}
FIELDS = {"H": "hurst", "nu": "poisson", "v": 1, "pressure": 2}


def leaf_of(tree, name):
    """The leaf of the arguments that a case's parameter "solid1.E.2" names, and the index in it."""
    parts = name.split(".")
    index = tuple(int(part) for part in parts if part.isdigit())
    *owner, last = (part for part in parts if not part.isdigit())
    field = FIELDS.get(last, last)
    if not owner:
        return tree[field], index
    if owner == ["softening"]:
        return getattr(tree[0].softening, field), index
    body = getattr(tree[0], BODIES[owner[0][-1]])
    holder = body.material if owner[0].startswith("solid") else body.spectrum
    return getattr(holder if hasattr(holder, field) else holder.base, field), index


def assert_derivatives(name, rtol):
    """Forward = reverse, and both the differences of the oracle."""
    slopes, at = assert_modes_agree(name), arguments(CASES[name])
    values = np.abs(expected(CASES[name]))
    for parameter, exact in CASES[name]["derivatives"].items():
        number, index = leaf_of(at, parameter)
        slope = np.asarray(leaf_of(slopes, parameter)[0])[(slice(None), *index)]
        found = slope if parameter.endswith("angle") else slope * np.asarray(number)[index]
        exact = expected(exact)
        error = np.abs(found - exact) / np.maximum(values + np.abs(exact), np.finfo(float).tiny)
        assert (error <= rtol).all(), (parameter, found, exact)
