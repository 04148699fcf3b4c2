"""Plots of scenes and results. They need matplotlib: pip install 'rubberfric[plot]'.

Every function `plot_...` draws into the given axes, or into a new figure that pyplot does not manage, and
returns the axes. In a notebook, after `%matplotlib inline`, `plot_friction(result).figure` at the end of a
cell shows the figure. `any` chooses the plot for an object.
"""

from rubberfric.base.process.lazy import lazily

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from rubberfric.plot import style
    from rubberfric.plot.choice import any, save_accuracy_plot, save_figure, save_plot
    from rubberfric.plot.curves import (
        curve_labels,
        plot_accuracy,
        plot_area,
        plot_curve,
        plot_friction,
        plot_profile,
        plot_result,
        plot_separation,
    )
    from rubberfric.plot.ingredients import plot_modulus, plot_spectrum
    from rubberfric.plot.maps import plot_map, plot_sensitivity
    from rubberfric.plot.style import PANELS

__all__ = [
    "PANELS",
    "any",
    "curve_labels",
    "plot_accuracy",
    "plot_area",
    "plot_curve",
    "plot_friction",
    "plot_map",
    "plot_modulus",
    "plot_profile",
    "plot_result",
    "plot_sensitivity",
    "plot_separation",
    "plot_spectrum",
    "save_accuracy_plot",
    "save_figure",
    "save_plot",
    "style",
]

lazily(
    __name__,
    {
        "rubberfric.plot.choice": "any save_accuracy_plot save_figure save_plot",
        "rubberfric.plot.curves": (
            "curve_labels plot_accuracy plot_area plot_curve plot_friction plot_profile plot_result "
            "plot_separation"
        ),
        "rubberfric.plot.ingredients": "plot_modulus plot_spectrum",
        "rubberfric.plot.maps": "plot_map plot_sensitivity",
        "rubberfric.plot.style": "PANELS",
    },
    modules=("rubberfric.plot.style",),
)
