"""Plots over the wavevector. They need matplotlib."""

from collections.abc import Sequence

import numpy as np

from rubberfric.analysis.scales.profiles import Profile
from rubberfric.base.checks import check_kind
from rubberfric.plot.style import Panels, decades, legend, looks, several_axes

# Fields of Profile and axis labels, from top to bottom.
_PROFILE_PANELS = (
    ("area", "area in contact\n$P(q)$ [-]"),
    ("friction_density", "friction per e-fold\n$d\\mu/d\\ln q$ [-]"),
    ("rms_slope", "rms slope up to $q$\n[-]"),
)


def plot_profile(profile: Profile, ax: Panels | None = None, labels: Sequence[str] | None = None) -> Panels:
    r"""Draw P(q), d mu / d ln q and the rms slope over the wavevector, one line per condition.

    In the panel of d mu / d ln q, equal areas are equal parts of the friction. A second scale above the top
    panel gives the wavelength 2 pi / q.

    Parameters
    ----------
    profile : Profile, from `rubberfric.analysis.profile`
    ax : sequence of three matplotlib axes, or None for a new figure
    labels : legend labels of the flattened conditions, or None

    Returns
    -------
    sequence of the axes, top to bottom

    Raises
    ------
    ValueError : if `labels` or `ax` has the wrong length.

    Examples
    --------
    >>> scene = rf.load_scene("data/tread_on_asphalt.toml")
    >>> profile = rf.analysis.profile(scene, [1e-3, 1e-1], 0.15e6)
    >>> axes = rf.plot.plot_profile(profile, labels=["1 mm/s", "10 cm/s"])
    >>> round(float(axes[2].lines[0].get_ydata()[-1]), 1)  # the rms slope of all roughness
    1.3
    """
    check_kind("profile", profile, Profile)
    count = int(np.prod(np.shape(profile.area)[:-1]))
    if labels is not None and len(labels) != count:
        raise ValueError(f"labels has {len(labels)} names: must have {count}, one for each condition")
    ax = several_axes(ax, [name for name, _ in _PROFILE_PANELS], (6.4, 7.0))
    order = np.argsort(np.asarray(profile.q), kind="stable")
    log_q = np.log10(np.asarray(profile.q)[order])
    for (name, label), axes in zip(_PROFILE_PANELS, ax, strict=True):
        values = np.asarray(getattr(profile, name))[..., order]
        curves = values.reshape(-1, log_q.size)
        names = [None] * len(curves) if labels is None or values.ndim < 2 else labels
        for curve, text, look in zip(curves, names, looks(len(curves), log_q.size), strict=True):
            axes.plot(log_q, curve, label=text, **look)
        axes.set_ylabel(label)
        axes.set_ylim(bottom=0)
        axes.grid(alpha=0.3)
    decades(ax[-1].xaxis, "wavevector $q$ [1/m]")
    if labels is not None:
        legend(ax[0])
    shift = np.log10(2 * np.pi)
    above = ax[0].secondary_xaxis("top", functions=(lambda x: shift - x, lambda x: shift - x))
    decades(above.xaxis, "wavelength $2\\pi/q$ [m]")
    return ax
