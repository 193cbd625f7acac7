"""
One constant, two signs
=======================

A thesis on printed TPU prints five Mooney–Rivlin constants twice, in a table and in a formula, and C02 with
different signs. The test behind them, which ends at 15.8 MPa, tells which one is a slip.
"""

import matplotlib.pyplot as plt
import numpy as np

import turgor as tg

table = tg.find_material("tpu-0deg-mooney-rivlin-5")
formula = tg.find_material("tpu-0deg-mooney-rivlin-5-formula")
stretch = np.linspace(1.0, 1 + table.measured["strain"], 300)

figure, axes = plt.subplots(figsize=(6, 3.6))
for entry, text in ((table, "table: C02 > 0"), (formula, "formula: C02 < 0")):
    axes.plot(stretch, entry.build.uniaxial(stretch), label=text)
axes.plot(1 + table.measured["strain"], table.measured["stress_MPa"], "k.", label="end of the test")
axes.axhline(0.0, color="0.8", linewidth=1)
axes.set(xlabel="stretch", ylabel="nominal stress / MPa", ylim=(-20, 20))
axes.legend()
figure.tight_layout()

# %%
# What the library says of each: nothing, and why the other cannot be.
print(f"table:   {table.contradiction or 'follows the test'}")
print(f"formula: {formula.contradiction}")

assert not table.contradiction
assert "compressive" in formula.contradiction
