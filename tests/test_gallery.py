"""Every gallery page runs, and the assertions in it hold."""

from __future__ import annotations

import runpy
from pathlib import Path

import matplotlib as mpl
import pytest

PAGES = sorted((Path(__file__).parents[1] / "examples" / "gallery").glob("plot_*.py"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_page(page):
    mpl.use("Agg")
    import matplotlib.pyplot as plt

    names = runpy.run_path(str(page))
    assert names["figure"].axes[0].lines
    plt.close("all")


def test_there_are_pages():
    assert len(PAGES) >= 2
