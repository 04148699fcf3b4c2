"""Accuracy settings of increasing work, and the cheapest that meets an error on a scene."""

import bisect

import jax
import numpy as np
from jax.typing import ArrayLike

from rubberfric.analysis.error_and_time import reference
from rubberfric.base.quadrature import Quadrature
from rubberfric.roughness.mesh.radial_mesh import build_mesh
from rubberfric.scene.pairs import pairs_of
from rubberfric.scene.scene import Scene

# Of increasing work. Few others of as few nodes have errors as small, on a road and on a pair of rubbers
# from 1e-8 to 1e2 m/s and from 1e3 to 1e7 Pa; the last two are for ranges far wider.
SETTINGS = (
    Quadrature(order=4, panels=3, graded=1, ratio=6.0, angular_order=4),
    Quadrature(order=7, panels=3, graded=1, ratio=4.0, angular_order=7),
    Quadrature(order=8, panels=5, graded=1, ratio=3.5, angular_order=7),
    Quadrature(order=8, panels=6, graded=1, ratio=6.0, angular_order=7),
    Quadrature(order=10, panels=7, graded=2, ratio=4.5, angular_order=10),
    Quadrature(order=14, panels=7, graded=4, ratio=3.0, angular_order=12),
    Quadrature(),
    Quadrature(order=16, panels=20, graded=12, ratio=4.0, angular_order=16),
)


def node_count(scene: Scene, quadrature: Quadrature) -> int:
    """Nodes in q that a point costs: where the contact is evaluated and where the stiffness is."""
    laws = [pair.law for pair in pairs_of(scene)]
    if not laws:
        return 0

    def nodes() -> tuple[jax.Array, jax.Array]:
        mesh = build_mesh(laws, quadrature)
        return mesh.q, mesh.angular_q

    return sum(x.size for x in jax.eval_shape(nodes))


def check_error(error: float) -> None:
    """ValueError unless a wanted error is a number between 0 and 1."""
    if isinstance(error, bool) or not isinstance(error, int | float) or not 0 < error < 1:
        raise ValueError(f"error = {error!r}: must be a number, > 0 and < 1")


def quadrature_for(
    scene: Scene,
    error: float,
    velocity: ArrayLike | None = None,
    pressure: ArrayLike | None = None,
    temperature: ArrayLike | None = None,
    *,
    gradients: bool = True,
) -> Quadrature:
    """The setting of least work that meets a relative error on a scene.

    Out of `SETTINGS`, in double precision, against a reference that validates itself
    (`rubberfric.analysis.error_and_time.reference`): 10 ... 30 s, most of them spent compiling.

    Parameters
    ----------
    scene : Scene
    error : largest relative error of area, friction, separation [-], 0 ... 1
    velocity, pressure, temperature : array_like, broadcastable [m/s], [Pa], [K]
        where the error must be met: every condition of use or its extremes. None: velocities
        1e-8 ... 1e2 m/s and pressures 1e3 ... 1e7 Pa, one a decade; every shift at its
        reference temperature.
    gradients : bool
        whether the gradients of the three must meet it as well.

    Returns
    -------
    Quadrature

    Raises
    ------
    ValueError : as `solve`; none meets the error, or there is no reference that could tell;
        double precision is switched off.
    """
    check_error(error)
    velocity = np.logspace(-8, 2, 11)[:, None] if velocity is None else velocity
    pressure = np.logspace(3, 7, 5) if pressure is None else pressure
    case = reference.case_of(scene, velocity, pressure, temperature)
    exact = reference.reference(case, gradients)
    agreement = exact.agreement.worst
    if agreement > reference.TRUSTED * error:
        raise ValueError(
            f"error = {error:g}: there is no reference for it on this scene, for two refinements "
            f"agree to {agreement:.1e} only; must be >= {agreement / reference.TRUSTED:.1e}"
        )
    settings = SETTINGS
    reached = {}

    def meets(setting: Quadrature) -> bool:
        found, _ = reference.measured(case, setting, gradients)
        reached[setting] = reference.compare(found, exact.exact, case).worst
        return reached[setting] <= error

    # By halves, for each compiles anew.
    first = bisect.bisect_left(settings, True, key=meets)
    if first == len(settings):
        raise ValueError(
            f"error = {error:g}: none of {first} settings meets it on this scene; "
            f"the best is {min(reached.values()):.1e} off"
        )
    return settings[first]
