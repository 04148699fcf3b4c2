"""Master curve and shift factors from isothermal sweeps of E' and E''."""

from collections.abc import Sequence

import numpy as np

from fitting.characterise.master_curve.laws import arrhenius_through, wlf_through
from fitting.characterise.master_curve.overlap import shifts_of
from fitting.characterise.master_curve.result import MasterCurve
from fitting.characterise.master_curve.sweeps import check_overlap, sweeps_of
from fitting.data.kinds import ModulusData
from fitting.parameters.constraints import is_number
from rubberfric.base import shown

_ROOM = 293.15


def fit_master_curve(
    isotherms: ModulusData | Sequence[ModulusData],
    reference: float | None = None,
    *,
    vertical: bool = False,
    same: float = 1.0,
) -> MasterCurve:
    r"""Shift factors, their law, and the master curve of sweeps at several temperatures.

    .. math:: E(\omega, T) = b_T E(a_T \omega, T_\mathrm{ref})

    Shifts are those that bring ln E' and ln E'' of all sweeps closest to one smooth curve
    (`fitting.characterise.master_curve.overlap`); laws go through them with their covariance
    [Williams, Landel & Ferry, J. Am. Chem. Soc. 77 (1955) 3701, doi:10.1021/ja01619a008].

    Parameters
    ----------
    isotherms : ModulusData with a temperature for every row, or a list of them
        in any order and several files; a sweep may be spread over them.
    reference : temperature that the master curve is for [K]: that of the sweep next to it is taken
        None: next to 20 °C.
    vertical : whether moduli are shifted, too, by b_T
    same : rows belong to one sweep whose temperatures lie closer together than this [K]
        a drift within a sweep is allowed for by the shifts of the others.

    Returns
    -------
    MasterCurve

    Raises
    ------
    ValueError
        one line: neighbouring sweeps that do not overlap, by their temperatures; a reference away from all
        sweeps; less than two temperatures or three points in a sweep; values <= 0; no temperature.

    Notes
    -----
    Errors of the data that are not given follow from the scatter of E' and of E'' about the curve, each by
    itself. Time-temperature superposition is an assumption: where E' and E'' want different shifts, the
    residuals show it. Bars hold for smooth relaxation spectra; with single terms a decade apart, whose
    ripples the curve cannot follow through the scatter, they are a quarter too small.
    """
    if not isinstance(vertical, bool):
        raise ValueError(f"vertical = {shown(vertical)}: must be True or False")
    if not (is_number(same) and same > 0):
        raise ValueError(f"same = {shown(same)}: must be a number > 0 [K]")
    if reference is not None and not (is_number(reference) and reference > 0):
        raise ValueError(f"reference = {shown(reference)}: must be None or a temperature > 0 [K]")
    sweeps = sweeps_of(isotherms, float(same))
    T = np.array([one.T for one in sweeps])
    nearest = int(np.argmin(np.abs(T - (_ROOM if reference is None else reference))))
    if reference is not None and abs(T[nearest] - reference) > same:
        raise ValueError(
            f"reference = {reference:g} K: must be the temperature of a sweep:"
            f" {', '.join(f'{one:.6g}' for one in T)} K"
        )
    shifts = shifts_of(sweeps, nearest, vertical)
    check_overlap(sweeps, shifts.log_a)
    moving = np.delete(np.arange(T.size), nearest)
    known = (T[moving], shifts.log_a[moving], shifts.covariance[np.ix_(moving, moving)], float(T[nearest]))
    sets = [isotherms] if isinstance(isotherms, ModulusData) else list(isotherms)
    order = np.argsort(shifts.t, kind="stable")
    which = np.repeat(np.arange(T.size), [one.t.size for one in sweeps])
    y = np.concatenate([one.y for one in sweeps], axis=1)
    moduli = np.exp(y - shifts.log_b[which])[:, order]
    errors = {}
    if sweeps[0].error is not None:
        sigma = (
            moduli * np.concatenate([one.error for one in sweeps if one.error is not None], axis=1)[:, order]
        )
        errors = {"sigma_storage": sigma[0], "sigma_loss": sigma[1]}
    bodies = {one.body for one in sets}
    data = ModulusData(
        np.exp(shifts.t[order]),
        *moduli,
        **errors,
        name=f"master curve of {sets[0].name}" if sets[0].name and len(sets) == 1 else "master curve",
        body=bodies.pop() if len(bodies) == 1 else None,
        check_units=False,
    )
    return MasterCurve(
        data=data,
        T=T,
        reference=nearest,
        shifts=shifts,
        wlf=wlf_through(*known),
        arrhenius=arrhenius_through(*known),
        of_sweep=which[order],
        residuals=(y - shifts.log_b[which] - shifts.smooth)[:, order],
        vertical=vertical,
    )
