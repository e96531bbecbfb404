"""Straight-line programs written once in Python and compiled without a loop or a call in them.

A program may use arithmetic, the functions below and loops whose bounds are known beforehand. It is run once with
values that write LLVM instructions instead of computing: an unrolled recurrence of thousands of instructions then costs
no type inference, which is what takes numba long, and no loop stands between the processor and its order of execution.

:func:`compiled` makes a function of two arrays of numbers; :func:`scalar` and :func:`packed` make a function of numbers
and one that handles LANES of them side by side with vector instructions. Each lane then goes through the same sequence
of correctly rounded operations as a single number does, so the results agree bit for bit.

With NUMBA_DISABLE_JIT the program runs as it stands; a fused multiply-add is then a multiplication and an addition.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Sequence
from itertools import zip_longest
from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils, config
from numba.extending import intrinsic

Program = Callable[[Any, Any], None]

LANES = 16  # two AVX-512 registers: while one of them waits for a result the other goes on


class _Value:
    """A double, a vector of them or a mask in the function that is being written."""

    __slots__ = ("builder", "value")

    def __init__(self, builder: ir.IRBuilder, value: ir.Value) -> None:
        self.builder = builder
        self.value = value

    def lift(self, other: Any) -> ir.Value:
        """Return the LLVM value of a number or a value."""
        if isinstance(other, _Value):
            return other.value
        kind = self.value.type
        if isinstance(kind, ir.VectorType):
            return ir.Constant(kind, [ir.Constant(ir.DoubleType(), float(other))] * kind.count)
        return ir.Constant(kind, float(other))

    def _make(self, value: ir.Value) -> _Value:
        return _Value(self.builder, value)

    def __add__(self, other: Any) -> _Value:
        return self._make(self.builder.fadd(self.value, self.lift(other)))

    def __radd__(self, other: Any) -> _Value:
        return self._make(self.builder.fadd(self.lift(other), self.value))

    def __sub__(self, other: Any) -> _Value:
        return self._make(self.builder.fsub(self.value, self.lift(other)))

    def __rsub__(self, other: Any) -> _Value:
        return self._make(self.builder.fsub(self.lift(other), self.value))

    def __mul__(self, other: Any) -> _Value:
        return self._make(self.builder.fmul(self.value, self.lift(other)))

    def __rmul__(self, other: Any) -> _Value:
        return self._make(self.builder.fmul(self.lift(other), self.value))

    def __truediv__(self, other: Any) -> _Value:
        return self._make(self.builder.fdiv(self.value, self.lift(other)))

    def __rtruediv__(self, other: Any) -> _Value:
        return self._make(self.builder.fdiv(self.lift(other), self.value))

    def __neg__(self) -> _Value:
        return self._make(self.builder.fneg(self.value))

    def __and__(self, other: _Value) -> _Value:
        return self._make(self.builder.and_(self.value, other.value))

    def __or__(self, other: _Value) -> _Value:
        return self._make(self.builder.or_(self.value, other.value))

    def __invert__(self) -> _Value:
        return self._make(self.builder.not_(self.value))

    def call(self, name: str, *others: Any) -> _Value:
        """Call an LLVM intrinsic function of doubles."""
        kind = self.value.type
        suffix = f"v{kind.count}f64" if isinstance(kind, ir.VectorType) else "f64"
        signature = ir.FunctionType(kind, [kind] * (1 + len(others)))
        write: Any = cgutils.get_or_insert_function
        function = write(self.builder.module, signature, f"{name}.{suffix}")
        return self._make(self.builder.call(function, [self.value, *(self.lift(other) for other in others)]))


def fma(a: Any, b: Any, c: Any) -> Any:
    """``a * b + c``, rounded once."""
    for value in (a, b, c):
        if isinstance(value, _Value):
            return _Value(value.builder, value.lift(a)).call("llvm.fma", b, c)
    return a * b + c


def absolute(a: Any) -> Any:
    """Absolute value."""
    return a.call("llvm.fabs") if isinstance(a, _Value) else np.abs(a)


def nearest(a: Any) -> Any:
    """Round to the nearest integer, half to even."""
    return a.call("llvm.rint") if isinstance(a, _Value) else np.rint(a)


def root(a: Any) -> Any:
    """Square root; NaN for a negative number."""
    return a.call("llvm.sqrt") if isinstance(a, _Value) else np.sqrt(a)


def _compare(relation: str, a: Any, b: Any) -> Any:
    value = a if isinstance(a, _Value) else b
    return _Value(value.builder, value.builder.fcmp_ordered(relation, value.lift(a), value.lift(b)))


def less(a: Any, b: Any) -> Any:
    """Mask of ``a < b``; false where one of them is not a number."""
    return _compare("<", a, b) if isinstance(a, _Value) or isinstance(b, _Value) else np.less(a, b)


def not_more(a: Any, b: Any) -> Any:
    """Mask of ``a <= b``; false where one of them is not a number."""
    return _compare("<=", a, b) if isinstance(a, _Value) or isinstance(b, _Value) else np.less_equal(a, b)


def where(mask: Any, then: Any, otherwise: Any) -> Any:
    """``then`` where a mask is true, else ``otherwise``."""
    if not isinstance(mask, _Value):
        return np.where(mask, then, otherwise)[()]
    kind: Any = ir.DoubleType()
    if isinstance(mask.value.type, ir.VectorType):
        kind = ir.VectorType(kind, mask.value.type.count)
    zero = _Value(mask.builder, ir.Constant(kind, None))
    return _Value(mask.builder, mask.builder.select(mask.value, zero.lift(then), zero.lift(otherwise)))


def where_less(a: Any, b: Any, then: Any, otherwise: Any) -> Any:
    """``then`` where ``a < b``, else ``otherwise``; also where one of them is not a number."""
    return where(less(a, b), then, otherwise)


def smaller(a: Any, b: Any) -> Any:
    """Return the smaller of two; ``b`` if one of them is not a number."""
    return where_less(a, b, a, b)


def larger(a: Any, b: Any) -> Any:
    """Return the larger of two; ``b`` if one of them is not a number."""
    return where_less(b, a, a, b)


def total(terms: Sequence[Any]) -> Any:
    """Sum of the terms of a power series, each of four chains from its small end, so that they run side by side."""
    chains = []
    for first in range(min(4, len(terms))):
        chain = None
        for term in reversed(terms[first::4]):
            chain = term if chain is None else chain + term
        chains.append(chain)
    while len(chains) > 1:
        chains = [a if b is None else a + b for a, b in zip_longest(chains[::2], chains[1::2])]
    return chains[0]


class _Numbers:
    """An array in the function that is being written, of doubles or of vectors of them; each is loaded once."""

    def __init__(self, builder: ir.IRBuilder, data: ir.Value, kind: ir.Type) -> None:
        self.builder = builder
        self.data = data if isinstance(kind, ir.DoubleType) else builder.bitcast(data, ir.PointerType(kind))
        self.kind = kind
        self.known: dict[int, _Value] = {}

    def _place(self, i: int) -> ir.Value:
        return self.builder.gep(self.data, [ir.Constant(ir.IntType(64), i)], source_etype=self.kind)

    def __getitem__(self, i: int) -> _Value:
        if i not in self.known:
            self.known[i] = _Value(self.builder, self.builder.load(self._place(i), align=8, typ=self.kind))
        return self.known[i]

    def __setitem__(self, i: int, value: Any) -> None:
        zero = _Value(self.builder, ir.Constant(self.kind, None))
        self.known[i] = _Value(self.builder, zero.lift(value))
        self.builder.store(self.known[i].value, self._place(i), align=8)


def compiled(program: Program) -> Callable[[np.ndarray, np.ndarray], None]:
    """Return a function ``f(z, c)`` that runs a program, for use in kernels, which compile it.

    Each call in a kernel writes the program into it: call it in one kernel of its own.

    Parameters
    ----------
    program : callable
        Of two indexed objects: it reads and writes numbers of ``z`` and of ``c``, counted in the order of memory.

    Returns
    -------
    callable
        Of two contiguous arrays of any shape.
    """
    if config.DISABLE_JIT:  # type: ignore[attr-defined]

        def interpreted(z: np.ndarray, c: np.ndarray) -> None:
            with np.errstate(all="ignore"):
                program(z.reshape(-1), c.reshape(-1))

        return interpreted

    @intrinsic
    def straight(typing_context: Any, z: Any, c: Any) -> Any:
        def write(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            program(
                *(
                    _Numbers(builder, context.make_array(of)(context, builder, argument).data, ir.DoubleType())
                    for of, argument in zip(signature.args, arguments, strict=True)
                )
            )
            return context.get_dummy_value()

        return types.void(z, c), write

    return cast(Callable[[np.ndarray, np.ndarray], None], straight)


def scalar(function: Callable[..., tuple[Any, ...]]) -> Callable[..., tuple[float, ...]]:
    """Return a function of floats that runs a program, for use in kernels, which compile it."""
    if config.DISABLE_JIT:  # type: ignore[attr-defined]

        def interpreted(*numbers: float) -> tuple[float, ...]:
            with np.errstate(all="ignore"):
                return function(*map(np.float64, numbers))

        return interpreted

    def straight(typing_context: Any, *numbers: Any) -> Any:
        results = len(function(*(np.full(len(numbers), math.nan))))

        def write(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            values = [_Value(builder, argument) for argument in arguments]
            found = [values[0].lift(value) for value in function(*values)]
            return context.make_tuple(builder, signature.return_type, found)

        returned: Any = types.UniTuple(types.float64, results)  # type: ignore[no-untyped-call]
        return returned(*(types.float64 for _ in numbers)), write

    # numba looks for names of the arguments.
    context = inspect.Parameter("typing_context", inspect.Parameter.POSITIONAL_OR_KEYWORD)
    names = (context, *inspect.signature(function).parameters.values())
    straight.__signature__ = inspect.Signature(names)  # type: ignore[attr-defined]
    return cast(Callable[..., tuple[float, ...]], intrinsic(straight))


def packed(
    function: Callable[..., tuple[Any, ...]], reads: Sequence[int], writes: Sequence[int]
) -> Callable[[np.ndarray], None]:
    """Return a function that runs a program on many lanes at once, for use in kernels, which compile it.

    Parameters
    ----------
    function : callable
        The program, as for :func:`scalar`.
    reads, writes : sequence of int
        Rows of its arguments and of its results.

    Returns
    -------
    callable
        Of a contiguous array, shape (rows, LANES).
    """
    if config.DISABLE_JIT:  # type: ignore[attr-defined]

        def interpreted(z: np.ndarray) -> None:
            with np.errstate(all="ignore"):
                for row, result in zip(writes, function(*(z[row].copy() for row in reads)), strict=True):
                    z[row] = result

        return interpreted

    @intrinsic
    def straight(typing_context: Any, z: Any) -> Any:
        def write(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
            rows = _Numbers(builder, data, ir.VectorType(ir.DoubleType(), LANES))
            for row, result in zip(writes, function(*(rows[row] for row in reads)), strict=True):
                rows[row] = result
            return context.get_dummy_value()

        return types.void(z), write

    return cast(Callable[[np.ndarray], None], straight)


def sine_cosine(angle: Any) -> tuple[Any, Any]:
    """Sine and cosine of an angle within a few turns of zero, to 1 ulp or two: Taylor series on [-pi/4, pi/4]."""
    quarter = nearest(angle * (2.0 / math.pi))
    # pi/2 in three parts, of which the first two are exact in 33 bits (Cody and Waite).
    x = fma(quarter, -1.57079632673412561417e00, angle)
    x = fma(quarter, -6.07710050630396597660e-11, x)
    x = fma(quarter, -2.02226624879595063154e-21, x)
    square = x * x
    odd, even = 0.0, 0.0
    for k in range(8, 0, -1):
        odd = fma(square, odd, (-1.0) ** k / math.factorial(2 * k + 1))
        even = fma(square, even, (-1.0) ** k / math.factorial(2 * k))
    s = fma(x, square * odd, x)
    c = fma(square, even, 1.0)
    # Which of the two, and with which sign: quarter modulo 4.
    left = quarter - 4.0 * nearest(quarter * 0.25)  # -2, -1, 0, 1 or 2
    swapped = 0.5 - absolute(absolute(left) - 1.0)  # positive where left is odd
    sine = where_less(0.0, swapped, c, s)
    cosine = where_less(0.0, swapped, s, c)
    sine = where_less(left, -0.5, -sine, where_less(1.5, left, -sine, sine))
    cosine = where_less(absolute(left), 1.5, where_less(0.5, left, -cosine, cosine), -cosine)
    return sine, cosine
