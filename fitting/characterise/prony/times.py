"""Which relaxation times a Prony series has, and whether the frequencies of its data reach them."""

import dataclasses

import numpy as np
from numpy.typing import ArrayLike

import rubberfric as rf
from fitting.data.kinds import ModulusData
from fitting.parameters.constraints import is_number
from rubberfric.base import POSITIVE, as_leaf, check_values, shown
from rubberfric.materials import Shift

# Decades between neighbouring frequencies; in a wider gap the loss of a term in its middle is
# down to a fifth wherever it is measured.
_GAP = 2.0
# Decades a given relaxation time may lie outside 1/omega; beyond, its loss is 1 % of its modulus.
_REACH = 2.0


def reduced(data: ModulusData, shift: Shift | None) -> ModulusData:
    """The data as they were at the reference temperature: E(a_T omega) = E(omega, T) / b_T."""
    if not isinstance(data, ModulusData):
        raise ValueError(f"data is a {type(data).__name__}: must be ModulusData, such as fitting.read gives")
    if data.temperature is None:
        return data
    if shift is None:
        raise ValueError(
            f"data {data.label!r}: have a temperature, but no shift is given: must be WLF, Arrhenius or"
            " TabulatedShift, or the data a master curve: curve = fit_master_curve(data), then curve.data"
        )
    shift.check_temperature(data.temperature)
    T = data.temperature
    # A solid of 1 Pa is b_T stiff.
    solid = rf.Prony(1.0, [1.0], [1.0], shift=shift)
    vertical = np.broadcast_to(np.asarray(rf.complex_modulus(solid, 0.0, T).real, float), T.shape)
    names = [name for name in (*data.values, *data.sigmas) if getattr(data, name) is not None]
    moduli = {name: getattr(data, name) / vertical for name in names}
    omega = data.omega * np.exp(np.asarray(shift.log_factor(T), float))
    return dataclasses.replace(
        data, omega=omega, temperature=None, name=data.label, check_units=False, **moduli
    )


def grid(omega: np.ndarray, per_decade: float) -> np.ndarray:
    """Relaxation times, as many per decade at least, from 1/omega_max to 1/omega_min."""
    if not (is_number(per_decade) and 0 < per_decade <= 100):
        raise ValueError(f"per_decade = {shown(per_decade)}: must be a number > 0, at most 100")
    decades = np.log10(omega.max() / omega.min())
    # 5.000000001 decades are five.
    return np.geomspace(1 / omega.max(), 1 / omega.min(), int(np.ceil(per_decade * decades - 1e-6)) + 1)


def given(data: ModulusData, tau: ArrayLike, omega: np.ndarray) -> np.ndarray:
    """Relaxation times that the caller chose, checked."""
    tau = np.asarray(as_leaf("tau", tau, 1), float)
    check_values("tau", tau, POSITIVE)
    if tau.size == 0:
        raise ValueError("tau is empty: must have at least one relaxation time")
    if np.unique(tau).size < tau.size:
        raise ValueError("tau: has equal relaxation times; must all be different")
    beyond = np.maximum(np.log10(tau * omega.min()), -np.log10(tau * omega.max()))
    worst = int(np.argmax(beyond))
    if beyond[worst] > _REACH:
        raise ValueError(
            f"tau[{worst}] = {tau[worst]:g} s: data {data.label!r} do not reach it; must be within"
            f" {_REACH:g} decades of 1/omega, {1 / omega.max():.3g} ... {1 / omega.min():.3g} s"
        )
    return tau


def fixed_modulus(E_inf: float | str) -> float | None:
    """A relaxed modulus that is not fitted, else None."""
    if isinstance(E_inf, str) and E_inf == "fit":
        return None
    if isinstance(E_inf, str) or not (is_number(E_inf) and E_inf >= 0):
        raise ValueError(f"E_inf = {shown(E_inf)}: must be 'fit' or a number >= 0 [Pa]")
    return float(E_inf)


def check_gaps(data: ModulusData, omega: np.ndarray) -> None:
    """ValueError where frequencies leave a gap in which a term would hide."""
    sorted_omega = np.sort(omega)
    gaps = np.diff(np.log10(sorted_omega))
    if gaps.size and gaps.max() > _GAP:
        i = int(np.argmax(gaps))
        raise ValueError(
            f"data {data.label!r}: nothing between the reduced frequencies {sorted_omega[i]:.3g} and"
            f" {sorted_omega[i + 1]:.3g} rad/s: curves must overlap, or be less than {_GAP:g} decades apart;"
            " or give smooth"
        )
