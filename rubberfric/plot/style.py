"""What the pictures share: labels with units, looks that differ in grey too, axes and legends.

Conditions differ by colour (of increasing lightness) and marker, parts of a quantity by line style.
"""

import numpy as np

# Quantities that have a panel: label, and scale and offset from the unit they are computed in.
PANELS = {
    "area": ("contact area\n$A/A_0$ [-]", 1.0, 0.0),
    "friction": ("friction coefficient\n$\\mu$ [-]", 1.0, 0.0),
    "separation": ("mean separation\n$\\bar u$ [µm]", 1e6, 0.0),
    "transverse_friction": ("transverse friction\n$\\mu_\\perp$ [-]", 1.0, 0.0),
    "flash_temperature": ("flash temperature\n$T$ [°C]", 1.0, -273.15),
}
LOG_V = "$\\log_{10}(v\\;/\\;\\mathrm{m\\,s^{-1}})$"
MARKERS = "os^DvPX<>p"
# Markers along a line that has more points.
_MARKS = 7


def colours(count):
    """As many colours, dark to light: viridis without its yellow, of a few colours its darker half."""
    from matplotlib import colormaps

    lightest = min(0.55 + 0.05 * count, 0.85)
    return colormaps["viridis"](np.linspace(0.0, lightest, count) if count > 1 else [0.25])


def looks(count, points):
    """Colour and markers of `count` lines of so many points; those of neighbours are staggered."""
    several = count > 1
    step = max(1, -(-points // _MARKS))
    return [
        {
            "color": colour,
            "marker": MARKERS[i % len(MARKERS)] if several or points < 2 else None,
            "markevery": (i * step // count, step),
            "markersize": 4.5,
        }
        for i, colour in enumerate(colours(count))
    ]


def one_axes(ax, size=(6.4, 4.0)):
    """The axes to draw into: `ax`, or of a new figure, which pyplot does not know, if it is None."""
    if ax is None:
        from matplotlib.figure import Figure

        return Figure(figsize=size, layout="constrained").subplots()
    from matplotlib.axes import Axes

    if not isinstance(ax, Axes):
        raise ValueError(f"ax is a {type(ax).__name__}: must be one matplotlib axes, or None")
    return ax


def check_kind(name, value, kind):
    """ValueError unless a value is an object of a class."""
    if not isinstance(value, kind):
        raise ValueError(f"{name} is a {type(value).__name__}: must be of class {kind.__name__}")


def several_axes(ax, names):
    """ValueError unless `ax` is a sequence of axes, one for each name."""
    from matplotlib.axes import Axes

    wanted = f"must have {len(names)}, for {', '.join(map(str, names))}; or be None"
    if isinstance(ax, Axes):
        raise ValueError(f"ax is one axes, not a sequence: {wanted}")
    if not np.iterable(ax) or not all(isinstance(one, Axes) for one in ax):
        raise ValueError(f"ax is a {type(ax).__name__}, not a sequence of axes: {wanted}")
    if len(ax) != len(names):
        raise ValueError(f"ax has {len(ax)} axes: {wanted}")


def legend(axes, handles=None, scale_right=False, inside="best"):
    """A legend beside the axes if their figure makes room for it, else inside.

    `scale_right`: the axes have a second scale on the right, whose lines "best" would not see.
    """
    handles = axes.get_legend_handles_labels()[0] if handles is None else handles
    if not handles:
        return
    look = {"loc": inside}
    if axes.figure.get_layout_engine() is not None:
        look = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.02)}
        if scale_right:
            # A pad counts in both directions: only beside the middle it moves nothing up or down.
            look = {"loc": "center left", "bbox_to_anchor": (1.0, 0.5), "borderaxespad": 6.0}
    axes.legend(handles=handles, fontsize="small", **look)


def shown_velocities(velocity):
    """Indices of the velocities > 0, which have a logarithm, in increasing order."""
    velocity = np.asarray(velocity)
    shown = np.flatnonzero(velocity > 0)
    return shown[np.argsort(velocity[shown], kind="stable")]


def vector(name, values, size=None, positive=False):
    """Numbers of a plot as a one-dimensional array; ValueError if they are none."""
    try:
        array = np.asarray(values, float)
    except (TypeError, ValueError):
        raise ValueError(f"{name} is a {type(values).__name__}: must be an array of numbers") from None
    if array.ndim != 1 or array.size == 0 or (size is not None and array.size != size):
        wanted = "one number or more" if size is None else f"{size} numbers"
        raise ValueError(f"{name} has shape {array.shape}: must be one-dimensional, {wanted}")
    if positive and not (np.isfinite(array) & (array > 0)).all():
        bad = int(np.argmin(np.isfinite(array) & (array > 0)))
        raise ValueError(f"{name}[{bad}] = {array[bad]:g}: must be > 0 and finite")
    return array
