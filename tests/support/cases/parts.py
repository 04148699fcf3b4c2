"""The scenes of reference/part_cases.json, and the compiled functions that test modules share."""

import jax
import jax.numpy as jnp
import numpy as np
from support.cases.stored import reference

import rubberfric as rf

QUANTITIES = ("area", "friction", "separation", "transverse_friction")
CASES = reference("part_cases")


def quantities(arguments):
    """Return area, friction, separation and transverse friction in one array."""
    found = rf.solve(*arguments, quantities=QUANTITIES)
    return jnp.stack([getattr(found, name) for name in QUANTITIES])


value = jax.jit(quantities)
reverse = jax.jit(jax.jacrev(quantities))


def expected(given):
    """The four quantities of a case, or their derivatives; isotropic roughness has no transverse friction."""
    return np.array([given.get(name, 0.0) for name in ("area", "friction", "separation", "transverse")])
