"""Scenes by name, with their conditions: what `tests/properties` and many other tests are run on."""

from problems.problem import POINTS as POINTS
from problems.problem import Problem as Problem
from problems.problem import compiled as compiled
from problems.problem import solved as solved
from problems.scenes import PROBLEMS as PROBLEMS
from problems.scenes import covering as covering
from problems.scenes import distinct as distinct
from problems.scenes import each as each
from problems.scenes import having as having
from problems.scenes import stored as stored
from problems.solids import CONTACT_MODELS as CONTACT_MODELS
from problems.solids import ELASTIC as ELASTIC
from problems.solids import FINE as FINE
from problems.solids import GROOVES as GROOVES
from problems.solids import HEATING as HEATING
from problems.solids import RIGID as RIGID
from problems.solids import ROAD as ROAD
from problems.solids import SHEAR as SHEAR
from problems.solids import SHIFTED_TREAD as SHIFTED_TREAD
from problems.solids import SOFT as SOFT
from problems.solids import SOFTENING as SOFTENING
from problems.solids import STEEL as STEEL
from problems.solids import TREAD as TREAD
from problems.solids import WLF as WLF
from problems.solids import WORN as WORN
from problems.solids import scene as scene
