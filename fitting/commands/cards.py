"""Command that writes the Prony series of a scene, a fit or a master curve as cards of other programs.

::

    rubberfric-fit cards scene.toml --out tread.inp --density 1150
    rubberfric-fit cards moduli.csv --program ansys --bulk 2e9 --out tread.mac

`rubberfric.io.write_prony` writes the cards. `fitting.fit_prony` fits a table of moduli, or of E(t) or D(t),
before.
"""

import argparse
from typing import Any

import numpy as np

import rubberfric as rf
from fitting.characterise.prony import fit_prony
from fitting.commands.arguments import CARD_SUFFIXES
from fitting.commands.laboratory import read_response
from fitting.commands.work import finish
from fitting.results.result import FitResult
from rubberfric.base import TABLE_SUFFIXES, Progress, as_path, listed, write_durably
from rubberfric.commands import Interrupts

# Frequencies of the moduli that are printed [rad/s].
_SHOWN = (1.0, 1e3, 1e6)


def run_cards(arguments: argparse.Namespace, interrupts: Interrupts, show: Progress) -> int:
    """Write cards, print a summary, and return the exit status."""
    del interrupts
    show(f"reading {arguments.input}")
    texts: list[str] = []
    material = _material(arguments, show, texts)
    program = arguments.program or CARD_SUFFIXES[as_path(arguments.out).suffix.lower()]
    temperature: Any = arguments.temperature
    if temperature is not None and len(temperature) == 1:
        temperature = temperature[0]
    cards = rf.io.write_prony(
        None,
        material,
        program,
        unit_stress=arguments.unit_stress,
        unit_temperature=arguments.unit_temperature,
        bulk=arguments.bulk,
        density=arguments.density,
        shift=arguments.shift is not False,
        name=arguments.name,
        temperature=temperature,
        hyperelastic=arguments.hyperelastic,
    )
    texts.append(_summary(material, program, arguments))
    finish(
        show,
        "\n".join(text.rstrip("\n") + "\n" for text in texts),
        ("writing", str(arguments.out), lambda path: write_durably(path, cards.encode())),
    )
    return 0


def _material(arguments, show, texts):
    """Return the Prony series of a scene, a fit or a table."""
    path = as_path(arguments.input)
    if path.suffix.lower() in TABLE_SUFFIXES:
        show("fitting a Prony series")
        series = fit_prony(
            read_response(arguments, path), arguments.per_decade, poisson=arguments.poisson or 0.5
        )
        texts.append(series.report())
        return series.material
    scene: Any = None
    if path.suffix.lower() == ".h5":
        try:
            scene = FitResult.load(path).scene
        except ValueError:
            scene = None  # a scene or a result of `rubberfric run`
    scene = rf.load_scene(path) if scene is None else scene
    if not isinstance(scene, rf.Scene):
        raise ValueError(f"{path}: has several scenes: must have one; save the scene to write")
    bodies = {side: getattr(scene, side).material for side in ("lower", "upper")}
    able = [side for side, material in bodies.items() if isinstance(material, rf.Prony | rf.PronyShear)]
    if arguments.body is None and len(able) != 1:
        which = f"body must be given, {listed(able)}" if able else "must have a material prony or prony_shear"
        raise ValueError(f"{path}: {which}")
    return bodies[arguments.body or able[0]]


def _summary(material, program, arguments):
    """Return a text with E' and E'' of the material, to compare them with the other program."""
    law = material.shift
    reference = None if law is None else float(law.reference_temperature)
    modulus = np.asarray(rf.complex_modulus(material, np.array(_SHOWN), reference))
    lines = [f"{material.tau.size} terms for {program}, in {arguments.unit_stress} and s"]
    at = "" if reference is None else f" at {reference:.6g} K"
    lines += [
        f"    E{at}, omega = {omega:g} rad/s: E' = {np.real(E):.6g} Pa, E'' = {np.imag(E):.6g} Pa"
        for omega, E in zip(_SHOWN, modulus.tolist(), strict=True)
    ]
    return "\n".join(lines)
