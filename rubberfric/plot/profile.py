"""Pictures of profiles: what each length scale does. They need matplotlib, as `rubberfric.plot`."""

from collections.abc import Sequence

import numpy as np

from rubberfric.analysis.by_wavevector import Profile
from rubberfric.plot.style import Panels, check_kind, legend, looks, several_axes

# Field of Profile, axis label; drawn from the top down.
PANELS = (
    ("area", "area in contact\n$P(q)$ [-]"),
    ("friction_density", "friction per e-fold\n$d\\mu/d\\ln q$ [-]"),
    ("rms_slope", "rms slope up to $q$\n[-]"),
)


def plot_profile(
    profile: Profile,
    ax: Panels | None = None,
    labels: Sequence[str] | None = None,
) -> Panels:
    r"""Draw P(q), d mu / d ln q and the rms slope over log10 q, a line for each condition.

    In the panel of d mu / d ln q, equal areas over log10 q are equal parts of the friction. A second
    scale above the topmost panel gives the wavelength 2 pi / q.

    Parameters
    ----------
    profile : Profile
        see `rubberfric.analysis.profile`
    ax : sequence of three matplotlib axes, or None for those of a new figure
    labels : names of the conditions in the order of their flattened array, for a legend; None: no legend

    Returns
    -------
    sequence of the axes, top to bottom

    Raises
    ------
    ValueError : `labels` or `ax` has another length.
    """
    check_kind("profile", profile, Profile)
    count = int(np.prod(np.shape(profile.area)[:-1]))
    if labels is not None and len(labels) != count:
        raise ValueError(f"labels has {len(labels)} names: must have {count}, one for each condition")
    ax = several_axes(ax, [name for name, _ in PANELS], (6.4, 7.0))
    order = np.argsort(np.asarray(profile.q), kind="stable")
    log_q = np.log10(np.asarray(profile.q)[order])
    for (name, label), axes in zip(PANELS, ax, strict=True):
        values = np.asarray(getattr(profile, name))[..., order]
        curves = values.reshape(-1, log_q.size)
        names = [None] * len(curves) if labels is None or values.ndim < 2 else labels
        for curve, text, look in zip(curves, names, looks(len(curves), log_q.size), strict=True):
            axes.plot(log_q, curve, label=text, **look)
        axes.set_ylabel(label)
        axes.set_ylim(bottom=0)
        axes.grid(alpha=0.3)
    ax[-1].set_xlabel("$\\log_{10}(q\\;/\\;\\mathrm{m^{-1}})$")
    if labels is not None:
        legend(ax[0])
    shift = np.log10(2 * np.pi)
    above = ax[0].secondary_xaxis("top", functions=(lambda x: shift - x, lambda x: shift - x))
    above.set_xlabel("$\\log_{10}(\\mathrm{wavelength}\\;/\\;\\mathrm{m})$")
    return ax
