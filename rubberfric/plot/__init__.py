"""Plots of scenes and results. They need matplotlib: pip install 'rubberfric[plot]'.

Every function `plot_...` draws into the given axes, or into a new figure that is not registered
with pyplot, and returns the axes. In a notebook, `plot_friction(result).figure` at the end of a cell shows
the figure after `%matplotlib inline`. `auto` chooses the function for an object.
"""

from rubberfric.base.lazy import lazily

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from rubberfric.plot import style as style
    from rubberfric.plot.choice import auto as auto
    from rubberfric.plot.choice import save_accuracy_plot as save_accuracy_plot
    from rubberfric.plot.choice import save_figure as save_figure
    from rubberfric.plot.choice import save_plot as save_plot
    from rubberfric.plot.curves import curve_labels as curve_labels
    from rubberfric.plot.curves import plot_area as plot_area
    from rubberfric.plot.curves import plot_curve as plot_curve
    from rubberfric.plot.curves import plot_friction as plot_friction
    from rubberfric.plot.curves import plot_result as plot_result
    from rubberfric.plot.curves import plot_separation as plot_separation
    from rubberfric.plot.errors import plot_accuracy as plot_accuracy
    from rubberfric.plot.ingredients import plot_modulus as plot_modulus
    from rubberfric.plot.ingredients import plot_spectrum as plot_spectrum
    from rubberfric.plot.maps import plot_map as plot_map
    from rubberfric.plot.maps import plot_sensitivity as plot_sensitivity
    from rubberfric.plot.over_wavevectors import plot_profile as plot_profile
    from rubberfric.plot.style import PANELS as PANELS

lazily(__name__, __file__)
