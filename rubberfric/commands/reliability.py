"""What the commands say below their tables: how far a result can be trusted."""

import numpy as np

from rubberfric.analysis.extrapolation import friction_outside_table
from rubberfric.materials.tabulated_modulus import TabulatedModulus


def outside_note(result):
    """One line saying how far the friction rests on extrapolated moduli; "" if no modulus is tabulated."""
    bodies = (result.scene.lower, result.scene.upper)
    if not any(isinstance(body.material, TabulatedModulus) for body in bodies):
        return ""
    share = np.max(np.abs(friction_outside_table(result.scene, *result.conditions.grid())))
    mu = "mu" if result.scene.shear is None else "the viscoelastic mu"
    return f"at most {100 * share:.2g} % of {mu} comes from frequencies outside the tabulated moduli"


def convergence_note(result):
    """One line saying how many temperatures of a heated scene are not a solution; "" if all are."""
    converged = result.solution.converged
    if converged is None:
        return ""
    # A temperature at a time: an array that stays in its file is not read at once.
    left = [np.size(plane) - np.count_nonzero(plane) for plane in converged]
    if not any(left):
        return ""
    i = int(np.flatnonzero(left)[0])
    j, k = np.argwhere(~converged[i])[0]
    return (
        f"the temperatures did not converge at {sum(left)} of {converged.size} points, "
        f"first at v = {result.conditions.velocity[k]:g} m/s, p = {result.conditions.pressure[j]:g} Pa: "
        "the values there are those of the last iterate"
    )
