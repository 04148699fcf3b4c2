"""Quantities of measured data: columns, units, rules, and plausible values."""

import numpy as np

from fitting.data.fields import Field, unit_rule
from rubberfric.base import POSITIVE

VELOCITY = Field(
    "v",
    "m/s",
    plausible=(unit_rule("must be -1000 ... 1000 m/s; is it in mm/s or um/s?", lambda v: np.abs(v) <= 1e3),),
)
PRESSURE = Field(
    "p",
    "Pa",
    POSITIVE,
    (
        unit_rule("must be >= 1 Pa; is it in MPa or GPa?", lambda p: p >= 1),
        unit_rule("must be <= 1e10 Pa", lambda p: p <= 1e10),
    ),
)
TEMPERATURE = Field(
    "T",
    "K",
    POSITIVE,
    (
        unit_rule("must be >= 100 K; is it in °C? then add 273.15", lambda T: T >= 100),
        unit_rule("must be <= 2000 K", lambda T: T <= 2000),
    ),
)
FREQUENCY = Field("omega", "rad/s", POSITIVE)
WAVENUMBER = Field(
    "q", "1/m", POSITIVE, (unit_rule("must be 1e-6 ... 1e12 1/m", lambda q: (q >= 1e-6) & (q <= 1e12)),)
)
FRICTION = Field(
    "mu", "-", plausible=(unit_rule("must be -50 ... 50; is it in percent?", lambda mu: np.abs(mu) <= 50),)
)
AREA = Field(
    "A_over_A0",
    "-",
    plausible=(
        POSITIVE,
        unit_rule("must be <= 1; is it in percent, or not divided by A0?", lambda A: A <= 1),
    ),
)
MODULUS = (POSITIVE, unit_rule("must be <= 1e13 Pa", lambda E: E <= 1e13))
STORAGE = Field(
    "E_stor",
    "Pa",
    # Judged by the largest value: E' of a melt or of a soft foam falls to some 100 Pa.
    plausible=(
        *MODULUS,
        unit_rule(
            "must be >= 1e3 Pa; is it in MPa or GPa?", lambda E: np.broadcast_to(E.max() >= 1e3, E.shape)
        ),
    ),
)
LOSS = Field(
    "E_loss",
    "Pa",
    plausible=(
        *MODULUS,
        unit_rule("must be >= 1 Pa; is it in MPa or GPa, or tan(delta)?", lambda E: E >= 1),
    ),
)
TIME = Field("t", "s", POSITIVE)
RELAXATION = STORAGE._replace(column="E_relax")
COMPLIANCE = Field(
    "D_creep",
    "1/Pa",
    plausible=(
        POSITIVE,
        unit_rule("must be 1e-13 ... 1 1/Pa; is it in 1/MPa or 1/GPa?", lambda D: (D >= 1e-13) & (D <= 1.0)),
    ),
)
SPECTRUM = Field(
    "C",
    "m^4",
    plausible=(POSITIVE, unit_rule("must be <= 1e3 m^4; is it in mm^4 or um^4?", lambda C: C <= 1e3)),
)
RATIO_ERROR = Field("sigma", "-", POSITIVE)
FORCE = Field("F_t", "N")
FORCE_ERROR = Field("sigma_F_t", "N", POSITIVE)
MOMENT = Field("moment", "N m")
MOMENT_ERROR = Field("sigma_moment", "N m", POSITIVE)
ANGLE = Field(
    "slip_angle",
    "rad",
    ("must be between -pi/2 and pi/2; is it in degrees?", lambda angle: np.abs(angle) < np.pi / 2),
)
RATIO = Field(
    "slip_ratio",
    "-",
    ("must be > -1; is it in percent?", lambda ratio: ratio > -1),
    (unit_rule("must be < 5; is it in percent?", lambda ratio: ratio < 5),),
)
SPEED = Field(
    "v_travel",
    "m/s",
    POSITIVE,
    (unit_rule("must be <= 200 m/s; is it in km/h or mm/s?", lambda speed: speed <= 200),),
)
LOAD = Field(
    "F_n",
    "N",
    POSITIVE,
    (unit_rule("must be 1e-3 ... 1e6 N; is it in kN?", lambda load: (load >= 1e-3) & (load <= 1e6)),),
)
# ln C of a single mode has the standard deviation 1.28, and 2.22 for the real mode at the highest wavevector.
SPECTRUM_ERROR = Field(
    "relative_sigma",
    "-",
    POSITIVE,
    (unit_rule("must be <= 2.5; is it in percent? 3 % is 0.03", lambda error: error <= 2.5),),
)
