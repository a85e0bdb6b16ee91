"""Shared fixtures. Measured data are third parties' and not in the repository: tests that use them skip without."""

import os
from pathlib import Path

import numpy as np
import pytest

DATA = Path(os.environ.get("GONIO_TEST_DATA", Path(__file__).parents[2] / "shared" / "data"))


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of measured data, beside the repository or named by GONIO_TEST_DATA."""
    if not DATA.is_dir():
        pytest.skip(f"no measured data at {DATA} (set GONIO_TEST_DATA to a folder that has them)")
    return DATA


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20070901)
