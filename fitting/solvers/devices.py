"""Devices on which several fits run side by side.

`OverFits` compiles a function of one fit for several fits. The fits are dealt to the devices in turn. A
processor takes its fits one after the other: one fit keeps a core busy, its working set stays in the cache,
empty places take no time, and the results are bit-identical for every number of fits. An accelerator takes
all its fits in one vectorised function. The results, a few numbers for each fit, go to all processes. Each
process computes the steps from them (`fitting.solvers.steps`), so all processes need equal processors.
"""

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.sharding import AxisType, Mesh, NamedSharding
from jax.sharding import PartitionSpec as P

from rubberfric.base import quick_options

AXIS = "fits"

# Largest number of points that a device evaluates in one call. The empty places of a single point hardly take
# time.
PLACES = 8


class Devices(NamedTuple):
    """Devices of a run. A value is hashable, and functions are compiled once for each value.

    Attributes
    ----------
    mesh : mesh of the devices, or None for JAX's default device
    vectorised : True if a device computes its fits simultaneously, False if one after the other
    places : largest number of points that a device evaluates in one call
    many : True for runs so long that functions are compiled with all optimisations
    """

    mesh: Mesh | None = None
    vectorised: bool = False
    places: int = PLACES
    many: bool = False

    @property
    def count(self) -> int:
        """Number of devices."""
        return 1 if self.mesh is None else self.mesh.size

    @property
    def several_processes(self) -> bool:
        """True if the devices belong to several processes."""
        return self.mesh is not None and len({device.process_index for device in self.mesh.devices.flat}) > 1

    def everywhere(self, tree: Any) -> Any:
        """Return a pytree of arrays with a copy on each device."""
        return tree if self.mesh is None else jax.tree.map(lambda a: _put(a, self.mesh, P()), tree)

    def split(self, tree: Any) -> Any:
        """Return a pytree of arrays with an equal part of the leading axis on each device."""
        return tree if self.mesh is None else jax.tree.map(lambda a: _put(a, self.mesh, P(AXIS)), tree)


def default_device() -> Devices:
    """Return JAX's default device."""
    return Devices(None, jax.default_backend() != "cpu")


def mesh_of(devices: Sequence[jax.Device]) -> Mesh | None:  # pyright: ignore[reportInvalidTypeForm]: a class
    """Return a mesh of devices, or None for JAX's default device alone."""
    if list(devices) == jax.devices()[:1]:
        return None
    return jax.make_mesh((len(devices),), (AXIS,), axis_types=(AxisType.Auto,), devices=devices)


class OverFits:
    """A function of one fit, compiled for several fits. The class serves as a decorator.

    Parameters
    ----------
    function : function of (static, shared, *arguments)
        `static` is hashable, `shared` is a pytree for all fits, and `arguments` are pytrees for one fit.
    """

    def __init__(self, function: Callable[..., Any]):
        self.function = function
        self.program = functools.lru_cache(maxsize=16)(self._program)

    def __call__(self, devices: Devices, static: Any, shared: Any, *arguments: Any) -> Any:
        """Return the results for fits that fill all places of the devices.

        `arguments` and results have a leading axis, with an equal number of fits for each device.
        """
        count = len(jax.tree.leaves(arguments)[0]) // devices.count
        counts = np.full(devices.count, count)
        return self._compiled(devices)(static, shared, *devices.split((counts, arguments)))

    def of_some(self, devices: Devices, static: Any, shared: Any, argument: np.ndarray) -> Any:
        """Return the results for at most `devices.places` fits of each device, as NumPy arrays."""
        place, *arguments = self._dealt(devices, argument)
        results = self._compiled(devices)(static, shared, *arguments)
        return jax.tree.map(lambda a: np.asarray(a)[place], results)

    def memory(self, devices: Devices, static: Any, shared: Any, *arguments: Any) -> int:
        """Return the memory of a device for one call [B]: arguments, results and temporaries.

        The function is compiled, and a later call with the same shapes does not compile it again.
        """
        counts = np.ones(devices.count, int)
        compiled: Any = self._compiled(devices)
        program = compiled.lower(static, shared, *devices.split((counts, arguments))).compile()
        needed = program.memory_analysis()
        return int(needed.temp_size_in_bytes + needed.argument_size_in_bytes + needed.output_size_in_bytes)

    def _dealt(self, devices, argument):
        """Return the place of each fit, the number of fits of each device, and the argument by place."""
        at = np.arange(len(argument))
        place = at % devices.count * devices.places + at // devices.count
        rows = np.zeros(devices.count * devices.places, int)  # empty places repeat the first fit
        rows[place] = at
        counts = np.bincount(at % devices.count, minlength=devices.count)
        return place, *devices.split((counts, (argument[rows],)))

    def _compiled(self, devices):
        return self.program(devices, not devices.many and quick_options() is not None)

    def _program(self, devices, is_quick):
        traced = jax.jit(self.function, static_argnums=0)  # traced only once

        def of_a_device(static, shared, count, arguments):
            of_a_fit = functools.partial(traced, static, shared)
            if devices.vectorised:
                return jax.vmap(of_a_fit)(*arguments)
            first = jax.tree.map(lambda a: a[0], arguments)
            places = len(jax.tree.leaves(arguments)[0])
            blank = jax.tree.map(
                lambda a: jnp.zeros((places, *a.shape), a.dtype), jax.eval_shape(of_a_fit, *first)
            )

            def put(i, results):
                new = of_a_fit(*jax.tree.map(lambda a: a[i], arguments))
                return jax.tree.map(lambda all_of, new: all_of.at[i].set(new), results, new)

            return jax.lax.fori_loop(0, count[0], put, blank)

        def several(static, shared, counts, arguments):
            if devices.mesh is None:
                return of_a_device(static, shared, counts, arguments)
            return jax.shard_map(
                functools.partial(of_a_device, static),
                mesh=devices.mesh,
                in_specs=(P(), P(AXIS), P(AXIS)),
                out_specs=P(AXIS),
                check_vma=False,
            )(shared, counts, arguments)

        several.__name__ = several.__qualname__ = f"several_{self.function.__name__.strip('_')}"
        quick = quick_options() if is_quick else None
        options: dict[str, Any] = {"static_argnums": 0, "compiler_options": quick}
        if devices.mesh is not None and devices.several_processes:
            options["out_shardings"] = NamedSharding(devices.mesh, P())
        return jax.jit(several, **options)


def _put(array, mesh, spec):
    # A callback fills the array, because the devices may belong to several processes.
    array = np.asarray(array)
    return jax.make_array_from_callback(array.shape, NamedSharding(mesh, spec), lambda index: array[index])
