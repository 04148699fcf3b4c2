"""Comparison of several fits of the same data: which scene predicts best, and whether this is significant."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from fitting.data.kinds import equal_data
from fitting.parameters.scenes import by_name
from fitting.results.record import FitRecord
from fitting.results.report import aligned_table
from fitting.uncertainty.criteria import ALONE, Criteria, criteria
from rubberfric.base import html, optional_library

# A smaller difference of the sum of ln p is not significant [Sivula, Magnusson, Matamoros & Vehtari,
# arXiv:2008.10296].
SMALL = 4.0
# A difference of fewer standard errors is not significant (Sivula et al.).
ERRORS = 2.0
HEADINGS = ("scene", "k", "chi-square", "reduced", "AIC", "AICc", "BIC", "LOO", "worse by", "+/-", "explains")
_OPTIONS = ("shear", "heating", "softening")


class Variant(NamedTuple):
    """One fit in a comparison. Lower values of aic, aicc, bic and loo are better."""

    name: str
    parameters: float  # number determined by the data, including estimated errors
    chisqr: float
    redchi: float
    aic: float
    aicc: float
    bic: float
    loo: float  # -2 sum ln p of the values, each left out in turn
    worse: float  # loo minus the lowest loo
    worse_stderr: float  # standard error of the difference; 0 of the best
    explains: bool | None  # the fit's verdict


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Comparison:
    """Result of comparing fits of the same data, made by `fitting.compare`.

    Attributes
    ----------
    variants : tuple of `Variant`, the lowest loo first
    words : interpretation of the differences, as lines of text
    """

    variants: tuple[Variant, ...]
    words: tuple[str, ...]

    @property
    def best(self) -> str:
        """Name of the variant in `alike` with the fewest parameters."""
        return min(self.alike, key=lambda variant: variant.parameters).name

    @property
    def alike(self) -> tuple[Variant, ...]:
        """Variants that the data do not distinguish from the variant with the lowest loo."""
        return tuple(variant for variant in self.variants if not is_distinguishable(variant))

    def __getitem__(self, name: str) -> Variant:
        """Return the variant with the given name."""
        return next(variant for variant in self.variants if variant.name == name)

    def report(self) -> str:
        """Return the table of the variants and the interpretation as text of several lines."""
        return "\n".join([*aligned_table([HEADINGS, *self._table()]), "", *self.words]) + "\n"

    def to_dataframe(self) -> Any:
        """Return the variants as a pandas.DataFrame indexed by name. Pandas must be installed."""
        return (
            optional_library("pandas")
            .DataFrame([variant._asdict() for variant in self.variants])
            .set_index("name")
        )

    def _repr_html_(self) -> str:
        return html.table([*self._table(), *self.words], HEADINGS, self.words[0])

    def __repr__(self) -> str:
        return f"<Comparison: {len(self.variants)} fits, best {self.best!r}>"

    def _table(self):
        said = {True: "yes", False: "NO", None: "?"}
        return [
            (
                variant.name,
                f"{variant.parameters:.3g}",
                f"{variant.chisqr:.4g}",
                f"{variant.redchi:.3g}" if np.isfinite(variant.redchi) else "none",
                *(f"{value:.2f}" for value in (variant.aic, variant.aicc, variant.bic, variant.loo)),
                f"{variant.worse:.2f}",
                f"{variant.worse_stderr:.2f}",
                said[variant.explains],
            )
            for variant in self.variants
        ]


def compare(results: Sequence[FitRecord] | Mapping[str, FitRecord]) -> Comparison:
    r"""Compare fits of several scenes to the same data, for example with and without contact shear.

    The comparison uses chi-square, AIC, AICc, BIC and LOO, the leave-one-out deviance

    .. math:: \mathrm{LOO} = -2 \sum_i \ln p(y_i \,|\, y_{-i}),\qquad
              s^2 = n \, \mathrm{var}_i \, (-2 \ln p_i^A + 2 \ln p_i^B)

    with the standard error s of the difference of two scenes A and B [Vehtari, Gelman & Gabry, Stat. Comput.
    27 (2017) 1413, arXiv:1507.04544]. `fitting.uncertainty.criteria` has the formulas.

    Parameters
    ----------
    results : FitResults of the same data, or a dict of them by name
        In a list, each fit is named after the optional parts of its scene.

    Returns
    -------
    Comparison : the variants, best first, and an interpretation of their differences.

    Raises
    ------
    ValueError : fewer than two fits, or fits with different data, losses or treatment of errors.

    Notes
    -----
    One value at a time is left out, so LOO measures predictions between neighbouring values. No criterion
    measures how well a scene extrapolates beyond the data. If errors were estimated, each fit uses its own.
    The criteria do not include the deviations from the priors.

    Examples
    --------
    E' and E'' of two relaxation times need a series of two terms:

    >>> omega, scene = np.logspace(0, 4, 9), rf.load_scene("data/tread_on_asphalt.toml")
    >>> two = rf.Prony(E_inf=2e6, E=[1e7, 1e7], tau=[1e-1, 1e-3])
    >>> E = np.asarray(rf.complex_modulus(two, omega))
    >>> data = fitting.ModulusData(omega, E.real, E.imag, relative=0.05, body="upper")
    >>> series = {"one": two.replace(E=[1e7], tau=[1e-2]), "two": two}
    >>> free = {"upper.material.E": fitting.Positive(), "upper.material.tau": fitting.Positive()}
    >>> fits = {n: fitting.fit(scene.replace("upper.material", x), data, free) for n, x in series.items()}
    >>> comparison = fitting.compare(fits)
    >>> comparison.best, [variant.name for variant in comparison.alike]
    ('two', ['two'])
    """
    named = _named(results)
    fits = list(named.values())
    for name, result in list(named.items())[1:]:
        _check_same(next(iter(named)), fits[0], name, result)
    by_name = {}
    for name, result in named.items():
        # An estimated amplitude and width of the model error are further parameters.
        error = result.discrepancy
        by_name[name] = criteria(result, 0 if error is None else error.estimated + bool(error.parts))
    order = sorted(named, key=lambda name: by_name[name].loo)
    variants = []
    for name in order:
        own, fit = by_name[name], named[name]
        away = 2 * (by_name[order[0]].left_out - own.left_out)
        stderr = float(np.sqrt(away.size * np.var(away, ddof=1))) if away.size > 1 else np.inf
        values = own.parameters, fit.chisqr, fit.redchi, own.aic, own.aicc, own.bic, own.loo
        variants.append(Variant(name, *values, float(away.sum()), stderr, fit.verdict.explains))
    return Comparison(tuple(variants), tuple(_words(variants, named, by_name)))


def is_distinguishable(variant: Variant) -> bool:
    """Return True if the data distinguish a variant from the variant with the lowest loo."""
    return variant.worse > max(2 * SMALL, ERRORS * variant.worse_stderr)


def _words(variants: list[Variant], fits: dict[str, FitRecord], by_name: dict[str, Criteria]) -> list[str]:
    alike = [variant for variant in variants if not is_distinguishable(variant)]
    worse = [variant for variant in variants if is_distinguishable(variant)]
    first = alike[0].name
    if len(alike) == 1:
        lines = [f"{first!r} predicts left-out values best, by more than chance"]
    else:
        simplest = min(alike, key=lambda variant: variant.parameters)
        names = ", ".join(repr(variant.name) for variant in alike)
        lines = [
            f"the data cannot tell {names} apart: the simplest is {simplest.name!r}"
            f" ({simplest.parameters:.3g} numbers determined by the data)"
        ]
    for variant in worse:
        errors = variant.worse / variant.worse_stderr if variant.worse_stderr > 0 else np.inf
        lines.append(
            f"{variant.name!r} predicts worse than {first!r}, by {variant.worse:.3g} ({errors:.2g} errors)"
        )
    by_aicc = min(variants, key=lambda variant: variant.aicc)
    if is_distinguishable(by_aicc):
        lines.append(
            f"AICc prefers {by_aicc.name!r}: it fits the values better than it predicts them; do not"
            " rely on it"
        )
    explains = [variant.explains for variant in variants]
    if all(answer is False for answer in explains):
        lines.append("NONE OF THEM EXPLAINS THE DATA: all scenes lack something")
    elif alike[0].explains is False:
        lines.append(f"{first!r} predicts best, but does not explain the data: see its verdict")
    for name, fit in fits.items():
        if not fit.success:
            lines.append(
                f"the fit of {name!r} did not converge, so its criteria are too large: {fit.message}"
            )
        alone = np.flatnonzero(by_name[name].leverage > ALONE)
        if alone.size:
            lines.append(
                f"{name!r}: LOO is not reliable, {alone.size} value{'s' * (alone.size > 1)} alone determine"
                f"{'s' * (alone.size == 1)} a number of the scene, first {_place(fit, alone[0])}"
            )
    if len({repr(sorted(fit.prior.items(), key=lambda item: item[0])) for fit in fits.values()}) > 1:
        lines.append("their priors differ: deviations from priors are not included in the criteria")
    return lines


def _place(fit, k):
    """Describe the data set and the conditions of value `k`, where `k` counts the values of all data sets."""
    for dataset in fit.data:
        if k < len(dataset):
            return f"{dataset.label!r} at {dataset.place(k)}"
        k -= len(dataset)
    raise IndexError(k)


def _named(results: Sequence[FitRecord] | Mapping[str, FitRecord]) -> dict[str, FitRecord]:
    """Return the fits as a dict by name, in a list after the optional parts of the scenes."""
    if isinstance(results, Mapping):
        named = dict(results)
    elif isinstance(results, list | tuple):
        named = {}
        for i, result in enumerate(results):
            name = _what(result) if isinstance(result, FitRecord) else f"results[{i}]"
            same = sum(known == name or known.startswith(f"{name} #") for known in named)
            named[f"{name} #{same + 1}" if same else name] = result
    else:
        raise ValueError(f"results is a {type(results).__name__}: must be a list or a dict of FitResults")
    for name, result in named.items():
        if not isinstance(result, FitRecord):
            raise ValueError(f"{name}: is a {type(result).__name__}: must be a FitResult")
    if len(named) < 2:
        raise ValueError(f"results has {len(named)} fits; there must be at least two")
    return named


def _what(fit: FitRecord) -> str:
    """Name the optional parts of the scene of a fit."""
    scenes = by_name(fit.scene_at_start).values()
    parts = [name for name in _OPTIONS if any(getattr(scene, name) is not None for scene in scenes)]
    parts += ["area_correction"] * any(scene.area_correction for scene in scenes)
    parts += ["discrepancy"] * (fit.discrepancy is not None)
    return " + ".join(parts) or "plain"


def _check_same(name: str, fit: FitRecord, other_name: str, other: FitRecord) -> None:
    """Raise ValueError unless two fits have the same data, loss and scaling of errors."""
    where = f"{other_name!r} and {name!r}"
    if len(fit.data) != len(other.data):
        raise ValueError(
            f"{where} are fits of {len(other.data)} and {len(fit.data)} data sets; both must be of the same"
            " data"
        )
    for i, (dataset, another) in enumerate(zip(fit.data, other.data, strict=True)):
        if not equal_data(dataset, another):
            raise ValueError(f"{where}: data[{i}], {another.label!r}, differs: must be the same data")
    problems = fit.problem, other.problem
    losses = [(problem.structure.loss, float(problem.numbers.width)) for problem in problems]
    if losses[0] != losses[1]:
        raise ValueError(f"{where}: losses are {losses[1]} and {losses[0]}; they must be the same")
    if (fit.error_scale != 1) != (other.error_scale != 1):
        raise ValueError(f"{where}: only one fit has errors scaled by the scatter: must be both or neither")
