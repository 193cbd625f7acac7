"""The peers' side of `compare_fits.py`: FElupe's `optimize` and scipy's `least_squares`, from usual start values.

Runs in an environment that has felupe and tensortrax, and not Turgor. The formulas are written out here once more, so
that scipy's fits share no line with Turgor's.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import felupe as fem
import felupe.constitution.tensortrax.models.hyperelastic as models
import numpy as np
from scipy.optimize import least_squares

POWERS = {
    "neo-hookean": [(1, 0)],
    "mooney-rivlin-2": [(1, 0), (0, 1)],
    "mooney-rivlin-3": [(1, 0), (0, 1), (1, 1)],
    "mooney-rivlin-5": [(1, 0), (0, 1), (2, 0), (1, 1), (0, 2)],
    "mooney-rivlin-9": [(1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3)],
    "yeoh-2": [(1, 0), (2, 0)],
    "yeoh-3": [(1, 0), (2, 0), (3, 0)],
}

FELUPE = {
    "neo-hookean": (models.neo_hooke, {"mu": 0.1}),
    "mooney-rivlin-2": (models.mooney_rivlin, {"C10": 0.1, "C01": 0.1}),
    "yeoh-3": (models.yeoh, {"C10": 0.1, "C20": 0.0, "C30": 0.0}),
    "ogden-2": (models.ogden, {"mu": [0.1, 0.1], "alpha": [2.0, -2.0]}),
    "ogden-3": (models.ogden, {"mu": [0.1, 0.1, 0.1], "alpha": [1.3, 5.0, -2.0]}),
    "arruda-boyce": (models.arruda_boyce, {"C1": 0.1, "limit": 5.0}),
    "van-der-waals": (models.van_der_waals, {"mu": 0.1, "limit": 20.0, "a": 0.1, "beta": 0.1}),
    "extended-tube": (models.extended_tube, {"Gc": 0.1, "delta": 0.01, "Ge": 0.1, "beta": 0.2}),
}
"""FElupe's own models of the same energy (its Ogden takes two terms or more), started from orders of magnitude."""

BOUNDS = {"van-der-waals": ([-np.inf, 0.0, -np.inf, 1.75], [np.inf, 1.0, np.inf, np.inf])}
"""In FElupe's order mu, beta, a, limit: the share of the second invariant beyond 0 … 1 is no material."""


def stretches(mode: str, x: np.ndarray) -> np.ndarray:
    second = {"uniaxial": x**-0.5, "equibiaxial": x, "planar": np.ones_like(x)}[mode]
    return np.stack([x, second, 1.0 / (x * second)])


def polynomial(powers: list[tuple[int, int]], constants: np.ndarray, a: np.ndarray) -> np.ndarray:
    I1, I2 = (a**2).sum(0), (a**-2.0).sum(0)
    u, v = I1 - 3.0, I2 - 3.0
    W1 = sum(c * i * u ** max(i - 1, 0) * v**j for c, (i, j) in zip(constants, powers, strict=True) if i)
    W2 = sum(c * j * u**i * v ** max(j - 1, 0) for c, (i, j) in zip(constants, powers, strict=True) if j)
    return 2.0 * (a[0] - a[2] ** 2 / a[0]) * W1 + 2.0 * (a[2] ** -2.0 / a[0] - a[0] ** -3.0) * W2


def ogden(constants: np.ndarray, a: np.ndarray) -> np.ndarray:
    terms = constants.reshape(-1, 2)
    return sum(2.0 * mu / alpha * (a[0] ** alpha - a[2] ** alpha) / a[0] for mu, alpha in terms)


def gent(constants: np.ndarray, a: np.ndarray) -> np.ndarray:
    mu, Jm = constants
    return mu * Jm / (Jm - (a**2).sum(0) + 3.0) * (a[0] - a[2] ** 2 / a[0])


def scipy_norm(model: str, tests: list[dict]) -> float | None:
    """Plain least squares from the usual start: moduli of 0.1 MPa, exponents 2, −2, 4, Jm twice what is needed."""
    parts = [(stretches(t["mode"], np.array(t["stretch"])), np.array(t["stress"])) for t in tests]
    if model in POWERS:
        start = np.full(len(POWERS[model]), 0.1)
        law = lambda c, a: polynomial(POWERS[model], c, a)  # noqa: E731
    elif model.startswith("ogden"):
        start, law = np.array([0.1, 2.0, 0.1, -2.0, 0.1, 4.0][: 2 * int(model[-1])]), ogden
    elif model == "gent":
        start, law = np.array([0.1, 2.0 * max((a**2).sum(0).max() - 3.0 for a, _ in parts)]), gent
    else:
        return None
    residual = lambda c: np.concatenate([law(c, a) - y for a, y in parts])  # noqa: E731
    with np.errstate(all="ignore"):
        try:
            found = least_squares(residual, start, x_scale="jac", max_nfev=5000)
        except ValueError:
            return None
    return float(np.sqrt(2.0 * found.cost))


def felupe_norm(model: str, tests: list[dict]) -> float | None:
    if model not in FELUPE:
        return None
    function, start = FELUPE[model]
    curves: dict[str, np.ndarray] = {}
    for test in tests:
        key = {"uniaxial": "ux", "planar": "ps", "equibiaxial": "bx"}[test["mode"]]
        curves[key] = np.array([test["stretch"], test["stress"]])
    umat = fem.Hyperelastic(function, **start)
    with np.errstate(all="ignore"):
        try:
            _, result = umat.optimize(**curves, incompressible=True, bounds=BOUNDS.get(model, (-np.inf, np.inf)))
        except (ValueError, np.linalg.LinAlgError):
            return None
    return float(np.sqrt(np.sum(result.fun**2)))


def main() -> None:
    out = Path(sys.argv[1])
    for file in sorted(out.glob("*.json")):
        if file.stem.startswith("peer-"):
            continue
        content = json.loads(file.read_text(encoding="utf-8"))
        peers = {
            "felupe": {model: felupe_norm(model, content["tests"]) for model in content["norms"]},
            "scipy": {model: scipy_norm(model, content["tests"]) for model in content["norms"]},
        }
        (out / f"peer-{file.name}").write_text(json.dumps(peers), encoding="utf-8")
        print(file.name, "done")


if __name__ == "__main__":
    main()
