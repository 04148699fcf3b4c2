"""The fit of the constants of the law to boundary-element cases, and what other fits extrapolate to."""

import functools
import itertools

import jax
import jax.numpy as jnp
import numpy as np
from problems import CONTACT_MODELS
from support.cases.law_cases import column, fitted, material_of, padded
from support.cases.law_tables import SETTING
from support.folders import DATA

import rubberfric as rf
from rubberfric.theory.area.boundary_elements_law import solve_law
from rubberfric.theory.area.law_roughness import CONSTANTS, prepare_law
from rubberfric.theory.structure import rough_surfaces_of

# Start of the fits; the prior about it has 1.5 times the size of each constant, and at least 0.5. DIRECTIONS
# are fitted to anisotropic roughness, with the other constants fixed.
START = {"c_0": -0.72, "c_D": 1.0, "c_f": 0.56, "c_A": 9.0, "h_0": 0.82, "h_D": 0.35, "h_F": 0.65, "c_T": 1.8}
START |= {"c_r": 4.0, "c_alpha": 0.3, "c_e": -0.33, "k": 0.13, "s": 0.8, "s_0": 1.645, "s_alpha": 0.16}
START |= {"a": 11.0, "c_v": 1.38, "c_w": 5.0, "c_phi": 1.5, "c_b": 1.0, "c_n": 0.5}
DIRECTIONS = {"c_g": 0.3, "c_eS": 0.3, "c_e0": 0.5, "c_eT": 0.5}
FLOORS = 0.035, 0.05  # error of the law: ln of area and of friction
ROBUST = 3.0  # errors beyond which a case has less weight [Charbonnier, pseudo-Huber]


def columns(chosen):
    """Return arrays of these cases, which share a compiled function."""
    found = []
    for case in chosen:
        series = material_of(case)
        E, tau = padded(series)
        q0, qr, hurst = 1 / case["ratio"], case["rolloff"] / case["ratio"], case["hurst"]
        height = 1 / float(rf.rms_slope(rf.SelfAffine(q0, qr, 1.0, hurst, h_rms=1.0)))
        rest = series.E_inf if series.relaxes else 1.0
        poisson = series.poisson if series.relaxes else 0.0
        grooves = case.get("stretch", 1.0), case.get("angle", 0.0)
        conditions = case["velocity"], case["pressure"]
        found.append((rest, E, tau, poisson, q0, qr, hurst, height, *grooves, *conditions))
    return tuple(jnp.asarray(np.array(entry)) for entry in zip(*found, strict=True))


def logs_by_law(constants, scene, velocity, pressure, by="alpha"):
    """Return ln of area and friction by the law with these constants, a dict.

    With `by` = "range", ln(q1/q0) / 2 replaces ln(alpha).
    """
    law = prepare_law(rough_surfaces_of(scene)[0], SETTING, CONSTANTS._replace(**constants))
    if by == "range":
        mesh = law.shape.mesh
        law = law._replace(shape=law.shape._replace(log_alpha=0.5 * jnp.log(mesh.last / mesh.first)))
    found = solve_law(law, velocity[None], pressure[None], None)
    return jnp.log(jnp.stack([found.area, jnp.where(found.mu > 0, found.mu, 1.0)])[:, 0])


@functools.partial(jax.jit, static_argnames=("names", "by"))
def logs_and_slopes(values, fixed, columns, names, by):
    def of_case(case):
        rest, E, tau, poisson, q0, qr, hurst, height, stretch, angle, *conditions = case
        body = rf.Body(rf.Prony(rest, E, tau, poisson=poisson))
        road = rf.SelfAffine(q0, qr, 1.0, hurst, h_rms=height)
        if "c_g" in names:
            road = rf.Anisotropic(road, stretch, angle)
        scene = rf.Scene(body, rf.Body(rf.Rigid(), road), **CONTACT_MODELS["law"])

        def logs(values):
            constants = fixed | dict(zip(names, values, strict=True))
            return logs_by_law(constants, scene, *conditions, by)

        return logs(values), jax.jacfwd(logs)(values)

    return jax.lax.map(of_case, columns)


@functools.cache
def fit(by="alpha", widest=np.inf):
    """Fit the constants to the cases of `fitted` with q1/q0 < widest; return them and their covariance."""
    return fitted_constants(START, {}, [case for case in fitted() if case["ratio"] < widest], by)


def fitted_constants(start, fixed, chosen, by="alpha"):
    """Fit the constants in `start` to these cases; return an array of them and their covariance."""
    names, start = tuple(start), np.array(list(start.values()))
    sliding = column(chosen, "terms") > 0
    data = np.log([column(chosen, "area"), np.where(sliding, column(chosen, "friction"), 1.0)]).T
    errors = np.stack(
        [column(chosen, "area_error"), np.where(sliding, column(chosen, "friction_error"), 0)], -1
    )
    weight = np.stack([np.ones(sliding.size), sliding], -1) / np.hypot(errors, FLOORS)
    prior, given, x = np.maximum(1.5 * np.abs(start), 0.5), columns(chosen), start

    def cost(residual, x):
        large = np.sqrt(1 + (residual / ROBUST) ** 2)
        return 2 * ROBUST**2 * np.sum(large - 1) + np.sum(((x - start) / prior) ** 2)

    def evaluated(x):
        return (np.asarray(y) for y in logs_and_slopes(x, fixed, given, names, by))

    logs, slopes = evaluated(x)
    residual, damping = ((logs - data) * weight).ravel(), 1e-3
    for _ in range(40):
        robust = (1 + (residual / ROBUST) ** 2) ** -0.25
        slope = (slopes * weight[..., None]).reshape(-1, x.size) * robust[:, None]
        normal = slope.T @ slope + np.diag(1 / prior**2)
        downhill = slope.T @ (residual * robust) + (x - start) / prior**2
        step = -np.linalg.solve(normal + damping * np.diag(np.diag(normal)), downhill)
        logs, slopes_there = evaluated(x + step)
        after = ((logs - data) * weight).ravel()
        change = cost(residual, x) - cost(after, x + step)
        if not change > 0:
            damping *= 30
            if damping > 1e3:
                break
            continue
        x, residual, slopes, damping = x + step, after, slopes_there, damping / 10
        if change < 1e-4:
            break
    return x, np.linalg.inv(normal)


FORMS = {"law": ("alpha", np.inf), "narrow": ("alpha", 100.0), "range": ("range", np.inf)}
WIDE = (1e2, 1e3, 1e4)  # q1/q0; the largest of the cases is 512
VELOCITIES = (1e-4, 1e-2, 1.0, 10.0)  # [m/s]


@functools.partial(jax.jit, static_argnames="by")
def law_over_paper(values, scene, velocity, by):
    def logs(values):
        constants = dict(zip(START, values, strict=True))
        return logs_by_law(constants, scene.replace(CONTACT_MODELS["law"]), velocity, jnp.asarray(0.15e6), by)

    paper = rf.solve(scene, velocity, 0.15e6, quantities=("friction", "area"))
    return logs(values) - jnp.log(jnp.stack([paper.area, paper.friction])), jax.jacfwd(logs)(values)


@functools.cache
def extrapolated():
    """Return ln(law / paper) and its standard error by form, q1/q0, velocity, and area or friction."""
    tread, logs, errors = rf.load_scene(DATA / "tread_on_asphalt.toml"), {}, {}
    for form, (by, widest) in FORMS.items():
        x, covariance = fit(by, widest)
        for ratio, velocity in itertools.product(WIDE, VELOCITIES):
            scene = tread.replace("lower.spectrum.q1", ratio * tread.lower.spectrum.q0)
            found, slope = law_over_paper(x, scene, velocity, by)
            logs[form, ratio, velocity] = np.asarray(found)
            errors[form, ratio, velocity] = np.sqrt(np.einsum("ki,ij,kj->k", slope, covariance, slope))
    return logs, errors
