"""Models that a user writes as a strain-energy expression in a file; derivatives follow by computer algebra.

A file of this kind holds::

    name: my-rubber
    energy: mu/2*(I1 - 3) + c*log(I2/3)
    constants:
      mu: {unit: MPa}
      c: {unit: MPa}

`energy` is in the isochoric invariants ``I1`` and ``I2`` or in the isochoric stretches ``lambda1``, ``lambda2`` and
``lambda3``, linear in the constants that have a unit. A constant without unit is a number with values from which a fit
starts and bounds: ``a: {start: [0.5, 1, 3], bounds: [0.1, 10]}``. The expression is parsed, never executed.
"""

from __future__ import annotations

import ast
import dataclasses
import functools
import itertools
import keyword
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import yaml
from typing_extensions import override

from turgor.common.errors import InputError
from turgor.common.optional import require
from turgor.materials.hyperelastic import Hyperelastic, InvariantModel, StretchModel, modulus, number
from turgor.materials.kinematics import AT_REST, Array, zero_at_rest

INVARIANTS = ("I1", "I2")
STRETCHES = ("lambda1", "lambda2", "lambda3")
EXCESSES = ("I1 - 3", "I2 - 3")
"""What programs take in place of the invariants: never negative, which lets sympy simplify √((I1 − 3)²)."""
FUNCTIONS = ("exp", "log", "sqrt", "sinh", "cosh", "tanh")

_EVALUATED: dict[str, Callable[[Any], Any]] = {
    **{name: getattr(np, name) for name in FUNCTIONS},
    "Abs": np.abs,
    "sign": np.sign,
    # Of the jump of a sign: zero but at the kink itself, where the energy has no second derivative.
    "DiracDelta": np.zeros_like,
}
"""Numpy's for the functions of sympy that an energy and its derivatives may hold: √(x²) becomes |x|."""

_LONGEST = 2000
_NAME = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")
_SYMBOL = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_FORMAT = "a mapping with name, energy and constants"


class Program:
    """Numerical values of an energy and its derivatives, common parts computed once.

    The body cannot go beyond a pole of its energy, or where this has no real value, as beyond the limiting stretch of a
    logarithm: there the energy is infinite and its derivatives are NaN, as those of Gent's model are.

    Parameters
    ----------
    expressions
        The energy and its derivatives, of sympy.
    insides
        Of the same variables; positive on this side of each pole.
    """

    def __init__(self, expressions: Sequence[Any], insides: Sequence[Any]) -> None:
        sympy = require("sympy", "a model from a strain-energy expression")
        self._shared, self._results = sympy.cse([*expressions, *insides])
        self._count = len(expressions)

    def __call__(self, values: Mapping[str, Array | float]) -> list[Array]:
        """Return the values of all expressions, each of the common shape of `values`."""
        # Numpy's numbers: what Python does not divide, it makes infinite.
        known: dict[str, Any] = {name: np.asarray(value, dtype=float) for name, value in values.items()}
        shape = np.broadcast_shapes(*(np.shape(value) for value in values.values()))
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            for symbol, expression in self._shared:
                known[str(symbol)] = _evaluate(expression, known)
            found = [_evaluate(result, known) for result in self._results]
        found = [np.array(np.broadcast_to(value, shape), dtype=float) for value in found]
        (energy, *rest), insides = found[: self._count], found[self._count :]
        beyond = functools.reduce(np.logical_or, [inside <= 0.0 for inside in insides], np.isnan(energy))
        if not np.any(beyond):
            return [energy, *rest]
        return [np.where(beyond, np.inf, energy), *(np.where(beyond, np.nan, part) for part in rest)]


def _evaluate(expression: Any, known: Mapping[str, Any]) -> Any:
    """Evaluate one node of a sympy expression with numpy."""
    if expression.is_Symbol:
        return known[str(expression)]
    if expression.is_number:
        return float(expression)
    arguments = [_evaluate(argument, known) for argument in expression.args]
    if expression.is_Add:
        return functools.reduce(np.add, arguments)
    if expression.is_Mul:
        return functools.reduce(np.multiply, arguments)
    if expression.is_Pow:
        exponent = expression.args[1]
        return arguments[0] ** int(exponent) if exponent.is_Integer and exponent > 0 else arguments[0] ** arguments[1]
    return _EVALUATED[expression.func.__name__](*arguments)


@dataclass(frozen=True, kw_only=True)
class InvariantExpression(InvariantModel):
    """A user's model in Ī₁ and Ī₂; ``program`` gives W̄ and its five derivatives."""

    program: ClassVar[Program]

    @property
    @override
    def shear_modulus(self) -> float:
        _, W1, W2, *_ = self.derivatives(np.array(3.0), np.array(3.0))
        return 2.0 * float(W1 + W2)

    @override
    def derivatives(self, I1: Array, I2: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
        # Roots of I1 - 3 have no derivative at rest, and below it, where round-off may bring it, no value.
        excesses = [np.maximum(invariant - 3.0, AT_REST) for invariant in (I1, I2)]
        variables: dict[str, Array | float] = dict(zip(EXCESSES, excesses, strict=True))
        variables.update(self.parameters)
        W, W1, W2, *second = self.program(variables)
        W11, W12, W22 = (zero_at_rest(part, np.minimum(*excesses)) for part in second)
        return W, W1, W2, W11, W12, W22


@dataclass(frozen=True, kw_only=True)
class StretchExpression(StretchModel):
    """A user's model in λ̄₁, λ̄₂ and λ̄₃; ``program`` gives W̄, its gradient and the upper triangle of its Hessian."""

    program: ClassVar[Program]

    @property
    @override
    def shear_modulus(self) -> float:
        # Of the linearised law: 2 μ = W₁₁ - W₁₂ + W₁ at rest (Ogden 1984, §6.1.6).
        _, slope, curvature = self.derivatives(np.ones(3))
        return 0.5 * float(curvature[0, 0] - curvature[0, 1] + slope[0])

    @override
    def derivatives(self, stretches: Array) -> tuple[Array, Array, Array]:
        variables: dict[str, Array | float] = {name: stretches[..., i] for i, name in enumerate(STRETCHES)}
        variables.update(self.parameters)
        W, *rest = self.program(variables)
        curvature = np.empty((*stretches.shape, 3))
        for (i, j), value in zip(itertools.combinations_with_replacement(range(3), 2), rest[3:], strict=True):
            curvature[..., i, j] = curvature[..., j, i] = value
        return W, np.stack(rest[:3], axis=-1), curvature


_TAKEN = frozenset((*INVARIANTS, *STRETCHES, *FUNCTIONS, "program", *dir(InvariantExpression), *dir(StretchExpression)))
"""What a constant may not be called: a variable, a function, or what every material has, such as its density."""


def load_model(path: str | Path) -> type[Hyperelastic]:
    """Return the model that a file describes.

    Raises
    ------
    InputError
        If the file is not of this form, or its energy is not linear in its moduli or not symmetric in the stretches.
    """
    file = Path(path)
    try:
        document = yaml.safe_load(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"the file cannot be read ({error.strerror})", file=file, expected=_FORMAT) from error
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError("this is not YAML", file=file, expected=_FORMAT) from error
    try:
        return define_model(document, str(file.resolve()))
    except InputError as error:
        raise error.at(file=file) from error


def define_model(document: object, file: str = "") -> type[Hyperelastic]:
    """Return the model of a parsed `file`; see :func:`load_model`."""
    if not isinstance(document, dict) or not {"name", "energy", "constants"} <= document.keys():
        raise InputError("this is not a model", expected=_FORMAT)
    if unknown := document.keys() - {"name", "energy", "constants", "source"}:
        raise InputError("unknown key", key=", ".join(sorted(map(str, unknown))), expected=_FORMAT)
    name = document["name"]
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise InputError("this is not a name", key="name", value=name, expected="lower-case words joined by hyphens")
    fields = _fields(document["constants"])
    energy, basis = _parse(document["energy"], set(fields))
    program, base = _differentiate(energy, basis, [key for key, f in fields.items() if f.metadata["constant"].linear])
    kind: type[Hyperelastic] = dataclasses.make_dataclass(
        f"User_{name.replace('-', '_')}",
        [(key, float, definition) for key, definition in fields.items()],
        bases=(base,),
        namespace={
            "name": name,
            "file": file,
            "program": program,
            "__doc__": f"W̄ = {document['energy']} (a user's model)",
        },
        frozen=True,
        kw_only=True,
    )
    if basis == STRETCHES:
        _check_symmetry(kind)
    return kind


def _fields(constants: object) -> dict[str, Any]:
    if not isinstance(constants, dict) or not constants:
        raise InputError("no constants are named", key="constants", expected="such as 'mu: {unit: MPa}'")
    fields: dict[str, Any] = {}
    for key, description in constants.items():
        place = f"constants.{key}"
        if not isinstance(key, str) or not _SYMBOL.fullmatch(key) or key in _TAKEN or keyword.iskeyword(key):
            expected = "letters and digits that have no meaning of their own yet"
            raise InputError("this cannot be the name of a constant", key=place, value=key, expected=expected)
        if not isinstance(description, dict) or description.keys() - {"unit", "start", "bounds"}:
            raise InputError("wrong description", key=place, expected="{unit: MPa} or {start: [1, 3], bounds: [0, 9]}")
        if "unit" in description:
            if description["unit"] != "MPa":
                expected = "MPa (leave the unit out for a number)"
                raise InputError("wrong unit", key=place, value=description["unit"], expected=expected)
            fields[key] = modulus()
            continue
        starts = description.get("start", [1.0])
        starts = starts if isinstance(starts, list) else [starts]
        bounds = description.get("bounds", [-math.inf, math.inf])
        values = [*starts, *bounds] if isinstance(bounds, list) else [None]
        if not all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in values) or len(bounds) != 2:
            raise InputError("wrong description", key=place, expected="{start: [1, 3], bounds: [0, 9]} with numbers")
        low, high = (float(v) for v in bounds)
        if not starts or not all(low <= v <= high for v in starts):
            raise InputError("a start lies outside the bounds", key=place, value=starts, expected=f"{low} to {high}")
        fields[key] = number([float(v) for v in starts], (low, high))
    return fields


def _parse(text: object, constants: set[str]) -> tuple[Any, tuple[str, ...]]:
    """Turn the text of an energy into a sympy expression; return it with the variables it is written in."""
    expected = "an expression such as mu/2*(I1 - 3)"
    if not isinstance(text, str) or not text.strip() or len(text) > _LONGEST:
        raise InputError("this is not an energy", key="energy", value=text, expected=expected)
    try:
        tree = ast.parse(text.strip().replace("^", "**"), mode="eval")
    except (SyntaxError, ValueError, RecursionError) as error:
        raise InputError("this is not an expression", key="energy", value=text, expected=expected) from error
    names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    unknown = names - constants - {*INVARIANTS, *STRETCHES, *FUNCTIONS}
    if unknown:
        allowed = ", ".join([*INVARIANTS, *STRETCHES, *FUNCTIONS, *sorted(constants)])
        raise InputError("unknown name", key="energy", value=", ".join(sorted(unknown)), expected=f"one of {allowed}")
    if names & set(INVARIANTS) and names & set(STRETCHES):
        raise InputError("invariants and stretches are mixed", key="energy", value=text, expected="one of the two")
    basis = INVARIANTS if names & set(INVARIANTS) else STRETCHES
    if not names & set(basis):
        raise InputError("the energy does not depend on the deformation", key="energy", value=text, expected=expected)
    try:
        energy = _translate(tree.body)
    except RecursionError as error:
        raise InputError("this expression is nested too deeply", key="energy") from error
    if unused := constants - {str(symbol) for symbol in energy.free_symbols}:
        raise InputError("a constant does not occur in the energy", key="constants", value=", ".join(sorted(unused)))
    return energy, basis


def _translate(node: ast.AST) -> Any:
    """Translate one node of the syntax tree; anything but arithmetic and the known functions is refused."""
    sympy = require("sympy", "a model from a strain-energy expression")
    if isinstance(node, ast.Constant):
        value = node.value
        if isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e12:
            return sympy.Integer(value) if isinstance(value, int) else sympy.Float(value)
    if isinstance(node, ast.Name):
        return sympy.Symbol(node.id, positive=node.id in (*INVARIANTS, *STRETCHES), real=True)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, (ast.USub, ast.UAdd)):
        operand = _translate(node.operand)
        return -operand if isinstance(node.op, ast.USub) else operand
    if isinstance(node, ast.BinOp):
        left, right = _translate(node.left), _translate(node.right)
        if isinstance(node.op, ast.Add):
            return left + right
        if isinstance(node.op, ast.Sub):
            return left - right
        if isinstance(node.op, ast.Mult):
            return left * right
        if isinstance(node.op, ast.Div) and right != 0:
            return left / right
        # Powers of numbers become floats, and exponents stay small: 9**9**9 must not be computed exactly.
        if isinstance(node.op, ast.Pow) and not (right.is_number and abs(right) > 100):
            return sympy.Float(left) ** right if left.is_number and right.is_number else left**right
    if (
        isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id in FUNCTIONS
        and len(node.args) == 1
        and not node.keywords
    ):
        return getattr(sympy, node.func.id)(_translate(node.args[0]))
    raise InputError(
        "only arithmetic and known functions may be used",
        key="energy",
        value=ast.unparse(node),
        expected="numbers, + - * / **, brackets and " + ", ".join(FUNCTIONS),
    )


def _differentiate(energy: Any, basis: tuple[str, ...], moduli: Sequence[str]) -> tuple[Program, type[Hyperelastic]]:
    sympy = require("sympy", "a model from a strain-energy expression")
    _check_linear(energy, moduli)
    x = [sympy.Symbol(name, positive=True) for name in basis]
    W = energy
    if basis == INVARIANTS:
        excesses = [sympy.Symbol(name, nonnegative=True) for name in EXCESSES]
        W, x = energy.subs({invariant: 3 + y for invariant, y in zip(x, excesses, strict=True)}), excesses
    at_rest = dict.fromkeys(x, AT_REST if basis == INVARIANTS else 1)
    first = [sympy.diff(W, variable) for variable in x]
    pairs = itertools.combinations_with_replacement(range(len(x)), 2)
    second = [sympy.diff(first[i], x[j]) for i, j in pairs]
    expressions = [W - W.subs(at_rest), *first, *second]
    _check_evaluated(expressions, energy)
    poles = [power.base for power in W.atoms(sympy.Pow) if power.exp.could_extract_minus_sign()]
    insides = [base * base.subs(at_rest) for base in poles if base.free_symbols & set(x)]
    return Program(expressions, insides), InvariantExpression if basis == INVARIANTS else StretchExpression


def _check_linear(energy: Any, moduli: Sequence[str]) -> None:
    """Refuse an energy that is not linear in its moduli."""
    sympy = require("sympy", "a model from a strain-energy expression")
    linear = [symbol for symbol in energy.free_symbols if str(symbol) in moduli]
    at_zero = energy.subs(dict.fromkeys(linear, 0))
    bent = any(sympy.simplify(sympy.diff(energy, a, b)) != 0 for a in linear for b in linear)
    if not linear or bent or sympy.simplify(at_zero) != 0:
        raise InputError(
            "the energy must be linear in the constants that have a unit",
            key="energy",
            value=str(energy),
            expected="every term with one factor in MPa, and only one",
        )


def _check_evaluated(expressions: Sequence[Any], energy: Any) -> None:
    """Refuse an energy if it or a derivative cannot be evaluated."""
    sympy = require("sympy", "a model from a strain-energy expression")
    if any(expression.has(sympy.I, sympy.zoo, sympy.oo, -sympy.oo, sympy.nan) for expression in expressions):
        raise InputError("the energy has no real value", key="energy", value=str(energy), expected="finite real terms")
    calls = set[Any]().union(*(expression.atoms(sympy.Function) for expression in expressions))
    unknown = {call.func.__name__ for call in calls} - _EVALUATED.keys()
    if unknown:
        problem = f"the energy or its derivatives hold {', '.join(sorted(unknown))}, which cannot be evaluated"
        raise InputError(problem, key="energy", value=str(energy), expected="an energy without it")


def _check_symmetry(kind: type[Hyperelastic]) -> None:
    values = [1.0 if c.linear else c.starts[0] for c in kind.constants()]
    x = np.array([1.3, 0.9, 1.0 / (1.3 * 0.9)])
    energies = [float(kind.trial(values).principal(x[list(order)])[0]) for order in itertools.permutations(range(3))]
    if not np.allclose(energies, energies[0], rtol=1e-9):
        raise InputError(
            "the energy changes when two stretches are exchanged, so that it is not isotropic",
            key="energy",
            expected="the same terms in lambda1, lambda2 and lambda3",
        )
