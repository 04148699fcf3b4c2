"""A finer quadrature agrees with the usual one within the error that is stated for it."""

import numpy as np
from problems import PROBLEMS, ROAD, each

import rubberfric as rf

FINER = rf.Quadrature(order=18, panels=36, graded=16, ratio=3.5, angular_order=20, heat=264)


# The usual quadrature is made for ten decades, plateaus of nine decades, and loads of 10 Pa.
ROADS = {
    "ten decades": (ROAD.replace(q0=1.0, qr=1e3, q1=1e10, h_rms=1e-3), 1e5),
    "plateau of nine decades": (ROAD.replace(q0=1.0, qr=1e9, q1=1e10, h_rms=1e-9), 1e5),
    "no plateau, light load": (ROAD.replace(qr=100.0), 1e1),
    "ten decades, light load": (ROAD.replace(q0=1.0, qr=1e3, q1=1e10, h_rms=1e-3), 1e1),
}
RUBBER = PROBLEMS["rubber"]
LONG = [
    RUBBER._replace(name=name, scene=RUBBER.scene.replace({"lower.spectrum": road}), pressure=pressure)
    for name, (road, pressure) in ROADS.items()
]


def tolerance(problem):
    """Relative errors of the usual quadrature."""
    if problem.tags & {"adhesion"}:  # nodes follow the load
        return 3e-5
    if "law of a liquid" in problem.tags:  # `Quadrature` states 1e-7 for the law, whose E begins at 0 here
        return 1e-7
    if "tabulated" in problem.tags:  # with and without kinks that the softening moves
        return 1e-5 if "softening" in problem.tags else 1e-6
    return 1e-8 if "heating" in problem.tags else 2e-9


@each([*PROBLEMS.values(), *LONG], ("rubber", *(problem.name for problem in LONG)))
def test_a_finer_quadrature_agrees(problem):
    velocity = problem.velocity * np.array([1.0, 0.1, 10.0])
    usual, fine = (problem.solved(velocity=velocity, quadrature=quadrature) for quadrature in (None, FINER))
    for quantity in problem.names:
        error = np.abs(usual[quantity] - fine[quantity])
        floor = np.abs(fine["friction"]) * (quantity == "transverse_friction")
        assert (error <= tolerance(problem) * np.maximum(np.abs(fine[quantity]), floor)).all(), (
            quantity,
            error,
        )
