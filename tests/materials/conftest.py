"""Where the tests of real materials lie, and what is skipped without them."""

from __future__ import annotations

from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    if not SHARED.is_dir():
        pytest.skip(f"the measured curves are not part of the repository and {SHARED} is absent")
    return SHARED


@pytest.fixture(
    scope="session",
    params=["Dragon Skin 10 MEDIUM", "Dragon Skin 30", "Ecoflex 00-30", "Ecoflex 00-35 FAST"],
    ids=lambda name: name.replace(" ", "-"),
)
def tensile_file(request, shared_data) -> Path:
    return shared_data / "tensile" / f"{request.param}.csv"
