"""Pictures of scenes and results. They need matplotlib: pip install 'rubberfric[plot]'.

Every function `plot_...` draws into the axes that it is given, or into a new figure of its own that
pyplot does not know, and returns the axes: `plot_friction(result).figure` at the end of a cell shows
in a notebook, after `%matplotlib inline`. `any` picks the picture.
"""

from rubberfric.base.process.lazy import lazily

TYPE_CHECKING = False  # for type checkers it is true
if TYPE_CHECKING:
    from rubberfric.plot import style
    from rubberfric.plot.accuracy import plot_accuracy
    from rubberfric.plot.choice import any
    from rubberfric.plot.curves import (
        curve_labels,
        plot_area,
        plot_curve,
        plot_friction,
        plot_result,
        plot_separation,
    )
    from rubberfric.plot.ingredients.modulus import plot_modulus
    from rubberfric.plot.ingredients.spectrum import plot_spectrum
    from rubberfric.plot.map import plot_map
    from rubberfric.plot.profile import plot_profile
    from rubberfric.plot.save import save_accuracy_plot, save_figure, save_plot
    from rubberfric.plot.sensitivity import plot_sensitivity
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
        "rubberfric.plot.accuracy": "plot_accuracy",
        "rubberfric.plot.choice": "any",
        "rubberfric.plot.ingredients.modulus": "plot_modulus",
        "rubberfric.plot.ingredients.spectrum": "plot_spectrum",
        "rubberfric.plot.map": "plot_map",
        "rubberfric.plot.profile": "plot_profile",
        "rubberfric.plot.save": "save_accuracy_plot save_figure save_plot",
        "rubberfric.plot.sensitivity": "plot_sensitivity",
        "rubberfric.plot.style": "PANELS",
        "rubberfric.plot.curves": (
            "curve_labels plot_area plot_curve plot_friction plot_result plot_separation"
        ),
    },
    modules=("rubberfric.plot.style",),
)
