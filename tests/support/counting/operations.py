"""Count the operations of a function in its jaxpr."""

from collections import Counter

import jax
import numpy as np

# Primitives that cost more than an addition.
COSTLY = ("sqrt", "div", "exp", "expm1", "log", "log1p", "erf", "logistic", "tanh", "integer_pow", "pow")


def equations(jaxpr):
    """Yield all equations, with calls replaced by inner jaxprs; a loop's body once."""
    for equation in jaxpr.eqns:
        inner = [p for v in equation.params.values() for p in (v if isinstance(v, tuple | list) else [v])]
        inner = [getattr(p, "jaxpr", p) for p in inner if hasattr(p, "eqns") or hasattr(p, "jaxpr")]
        if inner:
            # A custom derivative has a rule and a function; only the function runs.
            for sub in inner[:1] if equation.primitive.name.startswith("custom_jvp") else inner:
                yield from equations(sub)
        else:
            yield equation


def primitives(function, *arguments):
    """Names of the operations, one for each equation."""
    return [e.primitive.name for e in equations(jax.make_jaxpr(function)(*arguments).jaxpr)]


def operations(function, *arguments):
    """Counter: elements written by every costly operation, and "multiply-add" of all products."""
    count = Counter()
    for e in equations(jax.make_jaxpr(function)(*arguments).jaxpr):
        name, size = e.primitive.name, int(np.prod(e.outvars[0].aval.shape))
        if name in COSTLY:
            count[name] += size
        if name == "dot_general":
            (contracted, _), _ = e.params["dimension_numbers"]
            count["multiply-add"] += size * int(np.prod([e.invars[0].aval.shape[i] for i in contracted]))
    return count


def costly(count):
    """All of a count but the products."""
    return sum(count[name] for name in COSTLY)


def work(function, *arguments):
    """Elements written by operations that cost more than an addition."""
    return costly(operations(function, *arguments))


def per_point(function, velocity, *arguments):
    """Return the operations of one more velocity (difference of two counts), and of the scene."""
    n = velocity.size
    some, more = (operations(function, *arguments, velocity[:k]) for k in (n // 2, n))
    step = {name: (more[name] - some[name]) / (n - n // 2) for name in more}
    fixed = {name: more[name] - n * step[name] for name in more}
    return Counter(step), Counter(fixed)
