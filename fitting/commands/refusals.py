"""How what is wrong with a job is said: with the name of its file."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from rubberfric.base import StrPath


@contextmanager
def about(path: StrPath) -> Iterator[None]:
    """Within it a ValueError of the input names the job file it comes from."""
    try:
        yield
    except np.linalg.LinAlgError:  # a ValueError, but not one of the input
        raise
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
