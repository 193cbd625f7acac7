"""
Fitting a rubber
================

Treloar's uniaxial test of 1944, the field's standard data, and three models fitted to it. What one test leaves open
shows in the equibiaxial response, which is what an inflated membrane feels.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import turgor as tg

DATA = Path(tg.__file__).parents[1] / "examples" / "data" / "treloar-1944-uniaxial.csv"

report = tg.fit(DATA, models=["neo-hookean", "yeoh-3", "ogden-2"], strain_range=(0, 3))
stretch = np.linspace(1, 4, 100)

figure, (uniaxial, equibiaxial) = plt.subplots(1, 2, figsize=(9, 3.6), sharex=True)
for fit in report.fits:
    uniaxial.plot(stretch, fit.material.uniaxial(stretch), label=f"{fit.model}, RMSE {1e3 * fit.rmse:.0f} kPa")
    equibiaxial.plot(stretch, fit.material.equibiaxial(stretch), label=fit.model)
measured = np.loadtxt(DATA, delimiter=",", skiprows=3)
uniaxial.plot(*measured[measured[:, 0] <= 4].T, "k.", label="Treloar 1944")
uniaxial.set(xlabel="stretch", ylabel="nominal stress / MPa", title="uniaxial: fitted")
equibiaxial.set(xlabel="stretch", title="equibiaxial: predicted", ylim=(0, 3))
uniaxial.legend()
equibiaxial.legend()
figure.tight_layout()

assert report.best.shear_modulus > 0.2
assert max(fit.r2 for fit in report.fits) > 0.995
