"""Flow through the gap of a contact: finite volumes for the Reynolds equation, with SciPy alone.

div(u^3 grad p) = 0 on a period, with a mean pressure gradient along one axis. Cells in contact let nothing
pass. Between cells the cube of the gap is the harmonic or the arithmetic mean of both cells. Harmonic means
let too little pass on a coarse grid, and arithmetic means too much.
"""

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.sparse.linalg import splu


def flow_tensor(gap, faces="harmonic"):
    """Return K of the mean flow K grad(p) / (12 viscosity), times 12 [m^3], shape (2, 2)."""
    cube = gap**3
    index = np.arange(cube.size).reshape(cube.shape)
    between = [_between(cube, np.roll(cube, -1, axis), faces) for axis in (0, 1)]
    values = np.concatenate([one.ravel() for one in between])
    rows = np.concatenate([index.ravel()] * 2)
    columns = np.concatenate([np.roll(index, -1, axis).ravel() for axis in (0, 1)])
    some = values > 0
    network = sparse.coo_matrix((values[some], (rows[some], columns[some])), (cube.size, cube.size)).tocsr()
    network = network + network.T
    # The pressure in each connected region is known up to a constant.
    label = csgraph.connected_components(network, directed=False)[1]
    free = np.ones(cube.size, bool)
    free[np.unique(label, return_index=True)[1]] = False
    laplace = (sparse.diags(np.asarray(network.sum(1)).ravel()) - network).tocsr()[free][:, free].tocsc()
    drive = np.stack([(one - np.roll(one, 1, axis)).ravel()[free] for axis, one in enumerate(between)], -1)
    pressure = np.zeros((cube.size, 2))
    solver = splu(laplace, "MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    pressure[free] = solver.solve(drive)
    found = np.zeros((2, 2))
    for along in (0, 1):
        p = pressure[:, along].reshape(cube.shape)
        for axis, one in enumerate(between):
            found[axis, along] = np.mean(one * ((axis == along) + np.roll(p, -1, axis) - p))
    return found


def _between(one, other, faces):
    open_ = (one > 0) & (other > 0)
    if faces == "arithmetic":
        return np.where(open_, 0.5 * (one + other), 0.0)
    return np.where(open_, 2 * one * other / np.where(open_, one + other, 1.0), 0.0)
