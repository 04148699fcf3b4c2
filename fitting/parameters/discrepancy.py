r"""Model error of the theory: a Gaussian process over the logarithm of the velocity.

Measured values are assumed to be the theory times e^delta. delta is a Gaussian process over ln(v a_T) with
the mean 0 [Kennedy & O'Hagan, J. R. Stat. Soc. B 63 (2001) 425]. With a given width w its covariance is

.. math:: \mathrm{cov}(\delta_i, \delta_j) = \frac{a^2}{1 + (x_i - x_j)^2 / 2 w^2},\qquad x = \ln(v\, a_T)

a rational quadratic, which is a sum of squared exponentials of many widths around w [Rasmussen & Williams,
Gaussian Processes for Machine Learning (2006), eq. 4.19]. With an estimated width it is a sum of squared
exponentials,

.. math:: \mathrm{cov}(\delta_i, \delta_j) = \sum_k a_k^2 \exp(-(x_i - x_j)^2 / 2 w_k^2)

whose amplitudes are averages over the posterior of amplitude and width (`fitting.uncertainty.discrepancy`).
If the amplitude is estimated for the theory, the known difference to the law fitted to boundary elements is
added, with one unknown factor of variance 1 for all data,

.. math:: d_i d_j,\qquad d = \ln(law / theory)

at the fitted scene. Free parameters of contact shear or roughness can follow d, so that the data alone would
not show it.

The residuals of a fit, in units of the errors sigma of the logarithms, have the covariance
1 + cov / (sigma_i sigma_j). They are whitened by the inverse of its Cholesky factor. Error bars, bands and
verdict follow from the whitened residuals.
"""

import dataclasses
import math

import numpy as np

from fitting.parameters.constraints import is_number

# Widths of the posterior if the width is estimated [-], from a tenth of a decade to 1.6 decades.
WIDTHS = tuple(math.log(10) * 0.1 * 2**k for k in range(5))


@dataclasses.dataclass(frozen=True)
class Discrepancy:
    r"""A smooth relative error of the theory of friction over ln(v a_T).

    Parameters
    ----------
    amplitude : a, the standard deviation of the error [-], 0.25 stands for 25 %; or None
        None: averaged over its posterior. The prior is half lognormal (a factor of 1.6 up and down about its
        median) and half flat in ln a between 0.001 and 2. For `contact_model="boundary_elements"` the median
        is 0.1, and grows by 0.1 per decade of q1/q0 beyond 512. For the theory it is 0.3, and the known
        difference to the law is added (`law`). If the law cannot be compared, the median is 0.5, and
        amplitudes below 0.25 are excluded instead of the flat half.
    width : w, the range of ln v over which the error changes [-], 2.3 is a decade; or None
        None: averaged over the posterior of widths from a tenth of a decade to 1.6 decades.
    shared : correlation between the errors of different curves at the same v a_T, 0 ... 1
        A curve is one data set at one pressure and temperature. 1: all curves have the same error; 0: the
        errors are independent.
    estimated : True if the amplitude was estimated from the data; set by a fit
    parts : (amplitude, width) of every squared exponential of an estimated width; set by a fit
    law : ln(law / theory) of every friction and area value, 0 for other data; set by a fit
        `amplitude` contains its root mean square, and cannot be smaller.
    remark : reason why the discrepancy may not suit the data, "" if none was found; set by a fit

    In 20 random scenes (friction from boundary elements at 12 velocities over five decades, 3 % noise,
    `area_correction`, moduli known beforehand to 30 %, the height free), 95 % intervals contain the true
    value in these shares of cases:

    ============================  ============  ==========  ============  ==========
    discrepancy                   two pressures              one pressure
                                  moduli        heights     moduli        heights
    ============================  ============  ==========  ============  ==========
    none                          38 %          0 %         48 %          20 %
    estimated, the default        92 %          100 %       91 %          100 %
    0.5 over a decade, given      94 %          100 %       95 %          100 %
    ============================  ============  ==========  ============  ==========

    With `contact_model="boundary_elements"`, the default and two pressures of 20 other scenes, the shares are
    95 % for moduli and 98 % for heights (notebooks/how_true.md).

    In another test the friction of 60 random rubbers had errors of 20 % with wavelengths of 1-2, 2-4 and 4-8
    decades. With the default, 97, 96 and 94 % of the 95 % intervals contain the true value. The medians of
    the estimated remainders, 0.36, 0.36 and 0.34, are larger than 0.2, because prior and kernel favour wide
    intervals.

    Limits: the loss must be linear, and the friction data must have errors. The shift a_T is taken from the
    scene at the start of the fit. Intervals of the moduli of solids with one relaxation time contain the
    truth in five of six cases. If friction alone determines the moduli, fit and truth lie along a curved
    valley. Most moduli then have no interval, and other intervals can miss the truth; `FitResult.profile`
    follows the valley.

    Examples
    --------
    A model error of 25 % over a decade of velocity widens the error bar of the height:

    >>> scene, v = rf.load_scene("data/tread_on_asphalt.toml"), np.logspace(-4, -1, 6)
    >>> data = fitting.FrictionData(v, rf.friction(scene, v, 0.15e6), pressure=0.15e6, relative=0.03)
    >>> free, model_error = {"lower.spectrum.h_rms": fitting.Positive()}, fitting.Discrepancy(0.25, width=2.3)
    >>> plain, wide = (fitting.fit(scene, data, free, discrepancy=x) for x in (None, model_error))
    >>> bool(wide.stderr[0] > 3 * plain.stderr[0])
    True
    """

    amplitude: float | None = None
    width: float | None = None
    shared: float = 0.6
    estimated: bool = False
    parts: tuple[tuple[float, float], ...] = ()
    law: tuple[float, ...] = ()
    remark: str = ""

    def __post_init__(self) -> None:
        if self.amplitude is not None and not (is_number(self.amplitude) and self.amplitude >= 0):
            raise ValueError(f"Discrepancy: amplitude = {self.amplitude!r}: must be a number >= 0, or None")
        if self.width is not None and not (is_number(self.width) and self.width > 0):
            raise ValueError(f"Discrepancy: width = {self.width!r}: must be a finite number > 0, or None")
        if not (is_number(self.shared) and 0 <= self.shared <= 1):
            raise ValueError(f"Discrepancy: shared = {self.shared!r}: must be between 0 and 1")
        if not isinstance(self.estimated, bool):
            raise ValueError(f"Discrepancy: estimated = {self.estimated!r}: must be True or False")
        parts = np.asarray(self.parts, float)
        if parts.size and not (
            parts.ndim == 2 and parts.shape[1] == 2 and np.all(np.isfinite(parts) & (parts >= 0))
        ):
            raise ValueError(f"Discrepancy: parts = {self.parts!r}: must be pairs of amplitude and width")
        object.__setattr__(self, "parts", tuple((float(a), float(w)) for a, w in parts.reshape(-1, 2)))
        law = np.asarray(self.law, float)
        if law.ndim != 1 or not np.isfinite(law).all():
            raise ValueError("Discrepancy: law must be finite numbers, one for each value")
        object.__setattr__(self, "law", tuple(law.tolist()))

    @property
    def level(self) -> float:
        """Root mean square of `law` [-], 0 without it."""
        known = np.array([number for number in self.law if number])
        return float(np.sqrt(np.mean(known**2))) if known.size else 0.0

    @property
    def remainder(self) -> float | None:
        """Amplitude of the Gaussian process, which is the error except `law` [-]; None if not estimated."""
        if self.amplitude is None:
            return None
        return math.sqrt(max(self.amplitude**2 - self.level**2, 0.0))


def rational_quadratic(x: np.ndarray, width: float) -> np.ndarray:
    """Return the correlation of model errors at the abscissae x of one curve with a given width, (n, n)."""
    return 1 / (1 + 0.5 * ((x[:, None] - x) / width) ** 2)


def squared_exponential(x: np.ndarray, width: float) -> np.ndarray:
    """Return the correlation of model errors of one width at the abscissae x of one curve, (n, n)."""
    return np.exp(-0.5 * ((x[:, None] - x) / width) ** 2)


def between_curves(near: np.ndarray, curve: np.ndarray, shared: float) -> np.ndarray:
    """Return the correlation at the points of several curves from `near`, the one within a curve, (n, n).

    `curve` is the index of the curve of every point. Different curves have `shared` times the correlation.
    """
    return np.where(curve[:, None] == curve, near, shared * near)


def covariances(x: np.ndarray, curve: np.ndarray, discrepancy: Discrepancy) -> np.ndarray:
    """Return the covariance of the model errors except `law`, at x = ln(v a_T) on the curves, (n, n)."""
    amplitude, width = discrepancy.amplitude, discrepancy.width
    if amplitude is None or width is None:
        raise ValueError("Discrepancy: amplitude and width must be numbers, or be estimated first")
    near = (discrepancy.remainder or 0.0) ** 2 * rational_quadratic(x, width)
    if discrepancy.parts:
        near = np.sum([a**2 * squared_exponential(x, w) for a, w in discrepancy.parts], axis=0)
    return between_curves(near, curve, discrepancy.shared)


def text_of(discrepancy: Discrepancy) -> str:
    """Return a line of text that describes a discrepancy in a report."""
    if discrepancy.amplitude is None or discrepancy.width is None:
        return "an error of mu is allowed for, but its size was not estimated"
    source = "estimated from the data" if discrepancy.estimated else "as given"
    decades = discrepancy.width / math.log(10)
    known = ""
    if discrepancy.law:
        known = f"by {100 * discrepancy.level:.3g} %, the difference to the law of boundary elements, and "
    about = "about " if discrepancy.parts else ""
    rest = 100 * (discrepancy.remainder or 0.0)
    return (
        f"an error of mu is allowed for, {known}by {rest:.3g} % ({source}), smooth over"
        f" {about}{decades:.2g} decade{'s' * (decades != 1)} of v a_T; different curves share"
        f" {100 * discrepancy.shared:.3g} % of it"
    )
