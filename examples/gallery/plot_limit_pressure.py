"""
The limit pressure of a thick sphere
====================================

Beyond p/μ = 0.4935 a thick neo-Hookean sphere of radius ratio 1.5 has no equilibrium: it goes on growing while the
pressure falls. Volume control follows it through the limit; the closed form is Green and Zerna's.
"""

import itertools

import matplotlib.pyplot as plt
import numpy as np

import turgor as tg
from turgor.fem.loads import Pressure
from turgor.fem.supports import Sliding
from turgor.fem.system import System
from turgor.mesh.structured import shell_octant
from turgor.solver.linear import make_linear_solver
from turgor.solver.newton import NewtonOptions
from turgor.solver.path import solve_path
from turgor.solver.volume import VolumeWalk

MU = 0.1
rubber = tg.material("neo-hookean", {"C10": f"{MU / 2} MPa"})
planes = [Sliding("x0"), Sliding("y0"), Sliding("z0")]
mesh = shell_octant(1.0, 1.5, 2)
system = System(mesh, {"body": rubber}, planes, [Pressure("inner", 0.1 * MU)])

# %%
# A first equilibrium under pressure control, then steps of the volume.
start = solve_path(system, [1.0])[0]
linear = make_linear_solver(system.pattern.row_start, system.pattern.column)
step = 0.4 * system.conjugate(system.reference_state())
walk = VolumeWalk(system, linear, start, step, NewtonOptions())
states = [start, *itertools.islice(walk, 9)]

inner = mesh.surface_nodes("inner")
stretches = np.array([np.linalg.norm((mesh.points + e.state.u)[inner], axis=1).mean() for e in states])
pressures = np.array([e.state.loads[0] for e in states])


# %%
# The closed form.
def closed_form(stretch):
    """Return the pressure at an inner stretch, MPa."""
    outer = (1 + (stretch**3 - 1) / 1.5**3) ** (1 / 3)
    return MU * ((2 / outer + 0.5 / outer**4) - (2 / stretch + 0.5 / stretch**4))


line = np.linspace(1, stretches.max(), 200)
figure, axes = plt.subplots(figsize=(6, 3.6))
axes.plot(line, closed_form(line) / MU, "k-", label="closed form")
axes.plot(stretches, pressures / MU, "o", label=f"{mesh.n_cells} tetrahedra")
axes.set(xlabel="inner stretch", ylabel="pressure / shear modulus")
axes.legend()
figure.tight_layout()

assert np.abs(pressures / closed_form(stretches) - 1).max() < 5e-3
assert pressures.argmax() not in (0, len(pressures) - 1)
