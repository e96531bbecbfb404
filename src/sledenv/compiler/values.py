"""What straight-line programs compute with: numbers, vectors of eight, and functions of them.

A program runs either with numbers or, while it is compiled, with values that write LLVM instructions instead of
computing: see :mod:`sledenv.compiler.trace`. What is here takes either.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from llvmlite import ir

DOUBLE = ir.DoubleType()


class Value:
    """A double, a vector of eight or a mask in the function that is being written."""

    __slots__ = ("builder", "value")
    __array_ufunc__ = None  # an array times a value is the value's affair

    def __init__(self, builder: ir.IRBuilder, value: ir.Value) -> None:
        self.builder = builder
        self.value = value

    def lift(self, other: Any) -> ir.Value:
        """Return the LLVM value of a number, of an array of them or of a value."""
        return other.value if isinstance(other, Value) else constant(self.value.type, other)

    def make(self, value: ir.Value) -> Value:
        """Return another value in the same function."""
        return Value(self.builder, value)

    def __add__(self, other: Any) -> Value:
        return self.make(self.builder.fadd(self.value, self.lift(other)))

    def __radd__(self, other: Any) -> Value:
        return self.make(self.builder.fadd(self.lift(other), self.value))

    def __sub__(self, other: Any) -> Value:
        return self.make(self.builder.fsub(self.value, self.lift(other)))

    def __rsub__(self, other: Any) -> Value:
        return self.make(self.builder.fsub(self.lift(other), self.value))

    def __mul__(self, other: Any) -> Value:
        return self.make(self.builder.fmul(self.value, self.lift(other)))

    def __rmul__(self, other: Any) -> Value:
        return self.make(self.builder.fmul(self.lift(other), self.value))

    def __truediv__(self, other: Any) -> Value:
        return self.make(self.builder.fdiv(self.value, self.lift(other)))

    def __rtruediv__(self, other: Any) -> Value:
        return self.make(self.builder.fdiv(self.lift(other), self.value))

    def __neg__(self) -> Value:
        return self.make(self.builder.fneg(self.value))

    def __and__(self, other: Value) -> Value:
        return self.make(self.builder.and_(self.value, other.value))

    def __or__(self, other: Value) -> Value:
        return self.make(self.builder.or_(self.value, other.value))

    def __invert__(self) -> Value:
        return self.make(self.builder.not_(self.value))

    def call(self, name: str, *others: Any) -> Value:
        """Call an LLVM intrinsic function of doubles."""
        kind = self.value.type
        suffix = f"v{kind.count}f64" if isinstance(kind, ir.VectorType) else "f64"
        signature = ir.FunctionType(kind, [kind] * (1 + len(others)))
        module, name = self.builder.module, f"{name}.{suffix}"
        function = module.globals.get(name) or ir.Function(module, signature, name)
        return self.make(self.builder.call(function, [self.value, *(self.lift(other) for other in others)]))


def constant(kind: Any, number: Any) -> ir.Value:
    """LLVM constant of a number, or of an array of them."""
    if isinstance(kind, ir.VectorType):
        return ir.Constant(kind, [ir.Constant(DOUBLE, float(n)) for n in np.broadcast_to(number, kind.count)])
    return ir.Constant(kind, float(number))


def fma(a: Any, b: Any, c: Any) -> Any:
    """``a * b + c``, rounded once."""
    for value in (a, b, c):
        if isinstance(value, Value):
            return value.make(value.lift(a)).call("llvm.fma", b, c)
    return a * b + c


def absolute(a: Any) -> Any:
    """Absolute value."""
    return a.call("llvm.fabs") if isinstance(a, Value) else np.abs(a)


def with_sign(a: Any, b: Any) -> Any:
    """``a`` with the sign of ``b``."""
    return a.call("llvm.copysign", b) if isinstance(a, Value) else np.copysign(a, b)


def nearest(a: Any) -> Any:
    """Round to the nearest integer, half to even."""
    return a.call("llvm.rint") if isinstance(a, Value) else np.rint(a)


def root(a: Any) -> Any:
    """Square root; NaN for a negative number."""
    return a.call("llvm.sqrt") if isinstance(a, Value) else np.sqrt(a)


def _compare(relation: str, a: Any, b: Any) -> Any:
    value = a if isinstance(a, Value) else b
    return value.make(value.builder.fcmp_ordered(relation, value.lift(a), value.lift(b)))


def less(a: Any, b: Any) -> Any:
    """Mask of ``a < b``; false where one of them is not a number."""
    return _compare("<", a, b) if isinstance(a, Value) or isinstance(b, Value) else np.less(a, b)


def not_more(a: Any, b: Any) -> Any:
    """Mask of ``a <= b``; false where one of them is not a number."""
    return _compare("<=", a, b) if isinstance(a, Value) or isinstance(b, Value) else np.less_equal(a, b)


def equal(a: Any, b: Any) -> Any:
    """Mask of ``a == b``."""
    return _compare("==", a, b) if isinstance(a, Value) or isinstance(b, Value) else np.equal(a, b)


def where(mask: Any, then: Any, otherwise: Any) -> Any:
    """``then`` where a mask is true, else ``otherwise``."""
    if not isinstance(mask, Value):
        return np.where(mask, then, otherwise)[()]
    kind: Any = DOUBLE
    if isinstance(mask.value.type, ir.VectorType):
        kind = ir.VectorType(kind, mask.value.type.count)
    zero = mask.make(ir.Constant(kind, None))
    return mask.make(mask.builder.select(mask.value, zero.lift(then), zero.lift(otherwise)))


def where_less(a: Any, b: Any, then: Any, otherwise: Any) -> Any:
    """``then`` where ``a < b``, else ``otherwise``; also where one of them is not a number."""
    return where(less(a, b), then, otherwise)


def smaller(a: Any, b: Any) -> Any:
    """Return the smaller of two; ``b`` if one of them is not a number."""
    return where_less(a, b, a, b)


def larger(a: Any, b: Any) -> Any:
    """Return the larger of two; ``b`` if one of them is not a number."""
    return where_less(b, a, a, b)


def sign(a: Any) -> Any:
    """-1, 0 or 1."""
    return where_less(0.0, a, 1.0, where_less(a, 0.0, -1.0, 0.0))


_MANTISSA = 52  # bits
_BIAS = 1023


def rough_root(a: Any, n: Any) -> Any:
    """Root of order ``n`` > 13 of a positive number, less than .2 per cent too small; NaN for what is not finite."""
    logarithm = _bits(a) * 2.0**-_MANTISSA - _BIAS
    # Between powers of two the logarithm is that straight line and a parabola, its inverse a cubic polynomial.
    part = logarithm - nearest(logarithm - 0.5)
    power = fma(0.346 * part, 1.0 - part, logarithm) * (1.0 / n)
    below = nearest(power - 0.5)
    part = power - below
    scale = _of_bits((below + _BIAS) * 2.0**_MANTISSA)
    return scale * fma(part, fma(part, fma(part, 0.0783, 0.2263), 0.6954), 0.9991) + (a - a)


def _whole(kind: Any) -> Any:
    """Type of integers as many and as long as doubles."""
    return ir.VectorType(ir.IntType(64), kind.count) if isinstance(kind, ir.VectorType) else ir.IntType(64)


def _bits(a: Any) -> Any:
    """Whole number whose bits are those of a number."""
    if not isinstance(a, Value):
        return np.asarray(a).view(np.int64).astype(float)
    kind = a.value.type
    return a.make(a.builder.sitofp(a.builder.bitcast(a.value, _whole(kind)), kind))


def _of_bits(a: Any) -> Any:
    """Number whose bits are those of a whole number."""
    if not isinstance(a, Value):
        return np.where(np.isfinite(a), a, 0.0).astype(np.int64).view(float)
    kind = a.value.type
    return a.make(a.builder.bitcast(a.builder.fptosi(a.value, _whole(kind)), kind))


def rough_angle(sine: Any, cosine: Any) -> Any:
    """Angle of a direction, to a thousandth; the lengths of both arguments play no part."""
    along, across = absolute(cosine), absolute(sine)
    steep = less(along, across)
    ratio = where(steep, along, across) / where(steep, across, along)
    square = ratio * ratio
    angle = ratio * fma(square, fma(square, 0.0793, -0.2887), 0.9954)
    angle = where(steep, 0.5 * math.pi - angle, angle)
    angle = where_less(cosine, 0.0, math.pi - angle, angle)
    return where_less(sine, 0.0, -angle, angle)


def _polynomial(coefficients: Sequence[float], x: Any) -> Any:
    """Value of a polynomial with eight coefficients, by halves that do not wait for each other."""
    square = x * x
    twos = [fma(x, b, a) for a, b in zip(coefficients[::2], coefficients[1::2], strict=True)]
    fours = [fma(square, b, a) for a, b in zip(twos[::2], twos[1::2], strict=True)]
    return fma(square * square, fours[1], fours[0])


def sine_cosine(angle: Any) -> tuple[Any, Any]:
    """Sine and cosine of an angle within a few turns of zero, to 1 ulp or two: Taylor series on [-pi/4, pi/4]."""
    quarter = nearest(angle * (2.0 / math.pi))
    # pi/2 in three parts, of which the first two are exact in 33 bits (Cody and Waite).
    x = fma(quarter, -1.57079632673412561417e00, angle)
    x = fma(quarter, -6.07710050630396597660e-11, x)
    x = fma(quarter, -2.02226624879595063154e-21, x)
    square = x * x
    odd = _polynomial([(-1.0) ** k / math.factorial(2 * k + 1) for k in range(1, 9)], square)
    even = _polynomial([(-1.0) ** k / math.factorial(2 * k) for k in range(1, 9)], square)
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


def angle_of(sine: Any, cosine: Any) -> Any:
    """Angle of a direction, to 1 ulp or two; the lengths of both arguments play no part. NaN for two zeros."""
    rough = rough_angle(sine, cosine)
    s, c = sine_cosine(rough)
    # Tangent of the angle that is left: below a hundredth, so that four terms of the series suffice.
    left = fma(sine, c, -(cosine * s)) / fma(cosine, c, sine * s)
    square = left * left
    series = fma(square, fma(square, fma(square, -1.0 / 7.0, 1.0 / 5.0), -1.0 / 3.0), 1.0)
    return fma(left, series, rough)


def length_of(a: Any, b: Any) -> Any:
    """Length of a vector, to 1 ulp or two, without overflow or underflow in between."""
    a, b = absolute(a), absolute(b)
    long, short = larger(a, b), smaller(a, b)
    ratio = where_less(0.0, long, short / long, 0.0)
    return long * root(fma(ratio, ratio, 1.0))
