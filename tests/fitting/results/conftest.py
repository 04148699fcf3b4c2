"""Fits whose results are tested."""

import pytest
from support.scenes.fit_problems import fitted


@pytest.fixture
def joint():
    return fitted("joint")


@pytest.fixture
def quick():
    return fitted("without effect")
