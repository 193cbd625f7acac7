"""Newton's method, load stepping, linear solvers and hooks."""
