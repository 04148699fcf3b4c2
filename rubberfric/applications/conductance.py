r"""Conductance of a contact for heat or electric current, from its stiffness [Barber 2003].

Displacements and potentials of half-spaces obey the same equation, so that the incremental stiffness
:math:`K = -d\sigma_0/d\bar u` of a contact determines its conductance [Barber, Proc. R. Soc. A 459, 53
(2003), doi:10.1098/rspa.2002.1038],

.. math:: h = \frac{2 K}{E_r\,(1/\lambda_1 + 1/\lambda_2)},\qquad
          \frac{1}{E_r} = \frac{1-\nu_1^2}{E_1} + \frac{1-\nu_2^2}{E_2}

with the conductivities :math:`\lambda_j` and the relaxed moduli :math:`E_j`. A circle of radius a has the
stiffness 2 a E_r and the resistance (1/lambda_1 + 1/lambda_2) / (4 a).
"""

from collections.abc import Sequence

import jax
import jax.numpy as jnp

from rubberfric.analysis.interface import contact_stiffness
from rubberfric.base.checks import POSITIVE, ArrayLike, as_numbers
from rubberfric.base.quadrature import Quadrature
from rubberfric.materials.material import E_r
from rubberfric.scene.scene import Scene, check_without


def contact_conductance(
    scene: Scene,
    pressure: ArrayLike,
    temperature: ArrayLike | None = None,
    *,
    conductivity: Sequence[ArrayLike],
    quadrature: Quadrature | None = None,
) -> jax.Array:
    """Return the conductance per nominal area of two solids at rest.

    Parameters
    ----------
    scene : Scene of two half-spaces without adhesion, softening or a layer
    pressure, temperature : array_like, broadcastable [Pa], [K]
    conductivity : conductivity of the lower and of the upper solid, > 0 [W/(m K)] or [S/m]
    quadrature : Quadrature, static, or None, as in `rubberfric.separation`

    Returns
    -------
    array, broadcast shape [W/(m^2 K)] or [S/m^2]; infinite without roughness

    Raises
    ------
    ValueError : a part for which Barber's relation does not hold, a solid without relaxed modulus
        (E_inf = 0), a conductivity <= 0, and as `rubberfric.separation`

    Notes
    -----
    The stiffness of the theory is 3 to 12 % below that of boundary elements. The conductance is that of the
    contact areas alone, without air, radiation or oxide layers.

    Examples
    --------
    Rubber (0.2 W/(m K)) on aluminium (200 W/(m K)) at 0.1 MPa, in W/(m^2 K):

    >>> rough = rf.SelfAffine(q0=1e4, qr=3e4, q1=1e7, hurst=0.8, h_rms=1e-6)
    >>> scene = rf.Scene(rf.Body(rf.Elastic(70e9, 0.34), rough), rf.Body(rf.Elastic(10e6, 0.5)))
    >>> round(float(rf.applications.contact_conductance(scene, 1e5, conductivity=(200.0, 0.2))), -2)
    6300.0
    """
    check_half_spaces(scene, "the conductance")
    if len(conductivity) != 2:
        raise ValueError(f"conductivity has {len(conductivity)} values: must be (lower, upper)")
    first, second = (
        as_numbers(f"conductivity[{i}]", value, POSITIVE) for i, value in enumerate(conductivity)
    )
    # First, because it checks pressure and temperature.
    stiffness = contact_stiffness(scene, 0.0, pressure, temperature, quadrature=quadrature)
    compliance = relaxed_compliance(scene, temperature)
    return of_stiffness(stiffness, compliance, first, second)


def of_stiffness(
    stiffness: ArrayLike, compliance: ArrayLike, first: ArrayLike, second: ArrayLike
) -> jax.Array:
    """Return 2 K / (E_r (1/lambda_1 + 1/lambda_2)), where `compliance` is 1 / E_r."""
    return (
        2
        * jnp.asarray(stiffness)
        * jnp.asarray(compliance)
        / (1 / jnp.asarray(first) + 1 / jnp.asarray(second))
    )


def check_half_spaces(scene: Scene, what: str) -> None:
    """Raise ValueError unless `what` is defined for a scene: half-spaces without adhesion and softening."""
    check_without(scene, ("adhesion", "softening"), what)
    for name, body in (("lower", scene.lower), ("upper", scene.upper)):
        if not body.half_space:
            raise ValueError(f"scene.{name}.layer: must be None for {what}, which is of half-spaces")


def relaxed_compliance(scene: Scene, temperature: ArrayLike | None) -> jax.Array:
    """Return 1 / E_r of both solids in series at rest [1/Pa].

    A ValueError is raised if a solid has no modulus at rest.
    """
    bodies = (("lower", scene.lower), ("upper", scene.upper))
    return jnp.asarray(sum(_compliance(name, body.material, temperature) for name, body in bodies))


def _compliance(name, material, temperature):
    """Return 1 / E_r at rest [1/Pa], or 0.0 for a rigid solid."""
    if not material.deforms:
        return 0.0
    if material.is_liquid():
        raise ValueError(f"scene.{name}.material has no modulus at rest: E_inf must be > 0")
    return 1 / E_r(material, None, temperature)
