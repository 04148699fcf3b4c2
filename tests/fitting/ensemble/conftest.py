"""A small ensemble, and its undisturbed run."""

import pytest
from support.ensembles import ensemble_cases as cases

import fitting


@pytest.fixture(scope="session")
def members():
    return cases.modulus()


@pytest.fixture(scope="session")
def whole(members):
    """The run that nothing disturbs."""
    return fitting.run_ensemble(members, batch=4)
