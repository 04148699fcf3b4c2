"""Pictures of scenes and results. They need matplotlib: pip install 'rubberfric[plot]'.

Every function `plot_...` draws into the axes that it is given, or into a new figure of its own that
pyplot does not know, and returns the axes: `plot_friction(result).figure` at the end of a cell shows
in a notebook, after `%matplotlib inline`. `any` picks the picture.
"""

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
from rubberfric.plot.save import check_plot, save_accuracy_plot, save_figure, save_plot
from rubberfric.plot.sensitivity import plot_sensitivity
from rubberfric.plot.style import PANELS

__all__ = [
    "PANELS",
    "any",
    "check_plot",
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
