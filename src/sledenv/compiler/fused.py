"""``a * b + c`` rounded once, for processors without such an instruction: with the bits of those that have it.

Nearly always some thirty operations give it: the error of a product and that of a sum are numbers
themselves (Dekker, Knuth). Where they do not decide, :func:`exactly` computes with whole numbers.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Sequence
from typing import Any, Final

import llvmlite.binding as llvm
import numpy as np
from llvmlite import ir

from sledenv.compiler.jit import kernel
from sledenv.compiler.values import DOUBLE, Value, absolute, equal, less, where

_LEAST: Final = 2.0**-900  # of a product: its error is then no subnormal number
_LOWER: Final = 2**49 - 1  # bits of a number that has more than four significant ones
_HALF: Final = 2**26  # of what is cut off by
_UPPER: Final = 2**64 - 2**27
_WORD: Final = ir.IntType(64)
_PLACE: Final = ir.IntType(32)  # of a number in a vector
EXACTLY, _GENERAL = "fused.exactly", "fused.general"


class _Sum:
    """``a * b + c`` as a sum of three numbers, ``s + t + e``, exactly, unless something overflows or underflows.

    ``s`` is the rounded product plus c, rounded; ``t`` what rounding that sum has left, ``e`` what rounding the product
    has left.
    """

    def __init__(self, a: Value, b: Value, c: Value) -> None:
        self.product = a * b
        upper_a, upper_b = _upper(a), _upper(b)
        lower_a, lower_b = a - upper_a, b - upper_b
        rest = (self.product - upper_a * upper_b) - lower_a * upper_b
        self.e = lower_a * lower_b - (rest - upper_a * lower_b)
        self.s = self.product + c
        self.t = _left(self.product, c, self.s)
        self.r = self.t + self.e
        self.result = self.s + self.r
        self.normal = less(_LEAST, absolute(self.product))

    def sure(self) -> Any:
        """Mask of where ``result`` is sure, which is nearly everywhere.

        If ``t`` is 0, ``s + e`` is a sum of two numbers, rounded once. If not, ``s`` is at least half as large as the
        product, so ``t + e`` is at most 1.5 units in the last place of ``s``. That it is rounded, to ``r``, then
        changes the result only if ``r`` falls just between two results; such an ``r`` is a multiple of a quarter of
        that unit, and has three significant bits at most. One with so few bits is not sure, nor is what is not finite:
        where something overflows, ``r`` is infinite or not a number, and its lower bits are 0 too.
        """
        return _many_bits(self.r) & self.normal

    def sure_at_last(self, a: Value, b: Value) -> tuple[Value, Value]:
        """Return the result, and a mask of where it is sure: also of zero factors, or because ``r`` is exact."""
        zero = equal(a, 0.0) | equal(b, 0.0)
        exact = equal(_left(self.t, self.e, self.r), 0.0) & self.normal
        return where(zero, self.s, self.result), zero | exact | self.sure()


def _left(a: Value, b: Value, s: Value) -> Value:
    """What rounding ``a + b`` to ``s`` has left."""
    share = s - a
    return (a - (s - share)) + (b - share)


def _whole(kind: Any, number: int) -> ir.Constant:
    """Return a whole number, or as many as there are in a vector."""
    if isinstance(kind, ir.VectorType):
        return ir.Constant(ir.VectorType(_WORD, kind.count), [number] * kind.count)
    return ir.Constant(_WORD, number)


def _upper(a: Value) -> Value:
    """Nearest number of 26 bits; what is left has 26 bits too, so that products of both are exact."""
    half, mask = _whole(a.value.type, _HALF), _whole(a.value.type, _UPPER)
    bits = a.builder.add(a.builder.bitcast(a.value, half.type), half)
    return a.make(a.builder.bitcast(a.builder.and_(bits, mask), a.value.type))


def _many_bits(a: Value) -> Value:
    lower, zero = _whole(a.value.type, _LOWER), _whole(a.value.type, 0)
    bits = a.builder.and_(a.builder.bitcast(a.value, lower.type), lower)
    return a.make(a.builder.icmp_unsigned("!=", bits, zero))


# Whole numbers of 64 bits without sign; numba makes a float of one together with a number of another kind.
_U = np.uint64
_0, _1, _27, _52, _63, _64 = map(_U, (0, 1, 27, 52, 63, 64))
_FRACTION, _HALF_WORD = _U(2**52 - 1), _U(2**27 - 1)
_INFINITE: Final = 0x7FF  # exponent of what is not finite
_NORMALIZED: Final = 2.0**54  # makes a subnormal number normal


@kernel
def _parts(a: float) -> tuple[Any, Any]:
    """Whole number of 53 bits and power of two, whose product is the size of a finite number that is not 0."""
    subnormal = abs(a) < 2.0**-1022
    bits = np.float64(a * _NORMALIZED if subnormal else a).view(np.uint64)
    exponent = np.int64((bits >> _52) & _U(_INFINITE))
    return (bits & _FRACTION) | (_1 << _52), exponent - 1075 - (54 if subnormal else 0)


@kernel
def _shifted(high: Any, low: Any, by: int) -> tuple[Any, Any]:
    """Divide a number of two words by a power of two; where that is not exact, the last bit of the quotient is 1."""
    if by >= 64:
        high, low, by = _0, high | (_1 if low != _0 else _0), by - 64
    if by >= 64:
        return _0, _1 if low != _0 else _0
    if by == 0:
        return high, low
    right, left = _U(by), _U(64 - by)
    lost = _1 if low << left != _0 else _0
    return high >> right, (high << left) | (low >> right) | lost


@kernel
def exactly(a: float, b: float, c: float) -> float:
    """``a * b + c`` rounded once, for any numbers."""
    if a == 0.0 or b == 0.0 or not math.isfinite(a) or not math.isfinite(b):
        return a * b + c
    if c == 0.0:
        return a * b
    if not math.isfinite(c):
        return c
    # Both terms with their first bit in bit 124 or 125 of two words, so that their sum has room; then the smaller one
    # moves down to the power of two of the other. It loses bits only where no more than one bit of the sum can cancel.
    (whole_a, power_a), (whole_b, power_b), (whole_c, power_c) = _parts(a), _parts(b), _parts(c)
    upper_a, upper_b, lower_a, lower_b = whole_a >> _27, whole_b >> _27, whole_a & _HALF_WORD, whole_b & _HALF_WORD
    between, below = upper_a * lower_b + lower_a * upper_b, lower_a * lower_b
    low = (between << _27) + below
    high = ((upper_a * upper_b) >> _U(10)) + (between >> _U(37)) + (_1 if low < below else _0)
    more = (upper_a * upper_b) << _U(54)
    low = low + more
    high = high + (_1 if low < more else _0)
    high, low = (high << _U(20)) | (low >> _U(44)), low << _U(20)
    other_high, other_low = whole_c << _U(8), _0
    power, power_c = power_a + power_b - 20, power_c - 72
    if power >= power_c:
        other_high, other_low = _shifted(other_high, other_low, power - power_c)
    else:
        high, low = _shifted(high, low, power_c - power)
        power = power_c
    negative = (a < 0.0) != (b < 0.0)
    if negative == (c < 0.0):
        low = low + other_low
        high = high + other_high + (_1 if low < other_low else _0)
    else:
        if high < other_high or (high == other_high and low < other_low):
            high, low, other_high, other_low, negative = other_high, other_low, high, low, not negative
        high = high - other_high - (_1 if low < other_low else _0)
        low = low - other_low
    if high == _0 and low == _0:
        return 0.0
    # The first bit moves to bit 62 of the upper word, whose last bit takes part of what is below.
    while high >> _U(62) == _0:
        high, low, power = (high << _1) | (low >> _63), low << _1, power - 1
    if high >> _63 != _0:
        high, low = _shifted(high, low, 1)
        power += 1
    if low != _0:
        high = high | _1
    power += 64
    # Round to 53 bits, or to fewer in a subnormal number; a carry moves into the exponent by itself.
    by = max(10, -1074 - power)
    if by > 63:
        return -0.0 if negative else 0.0
    exponent = by + power + 1074
    rounded, left, half = high >> _U(by), high << _U(64 - by), _1 << _63
    if left > half or (left == half and rounded & _1 != _0):
        rounded = rounded + _1
    bits = rounded + (_U(exponent) << _52) if exponent < _INFINITE - 1 else _U(_INFINITE) << _52
    size = np.uint64(bits).view(np.float64)
    return -size if negative else size


# How a module gets them.

_COUNTS: Final = (1, 2, 4, 8)  # of numbers at once


def without_instruction(module: Any) -> Any:
    """Return a module of LLVM in which these programs stand for the instruction; it holds :func:`exactly` already.

    They are functions: copied to where they are called, they would make the module several times as large. There is
    one of a number, ``fused.f64``, and one of two at once, ``fused.v2f64``, which those of more numbers call. These two
    can be found from outside: see templates/kernel.js.
    """
    whole = llvm.parse_assembly(str(module).replace("@llvm.fma.", "@fused."))
    whole.link_in(llvm.parse_assembly(str(_programs())))
    for name in (EXACTLY, _GENERAL, *map(_name, _COUNTS[2:])):
        whole.get_function(name).linkage = llvm.Linkage.internal
    return whole


def _name(count: int) -> str:
    return "fused.f64" if count == 1 else f"fused.v{count}f64"


def _programs() -> ir.Module:
    """Return a module of the functions of one number and of several."""
    module = ir.Module()
    general = _general(module)
    for count in _COUNTS:
        kind = ir.VectorType(DOUBLE, count) if count > 1 else DOUBLE
        function = ir.Function(module, ir.FunctionType(kind, [kind] * 3), _name(count))
        builder = ir.IRBuilder(function.append_basic_block())
        if count > 2:
            function.attributes.add("alwaysinline")
            halves = [_halves(builder, vector, count // 2) for vector in function.args]
            half = module.get_global(_name(count // 2))
            both = [builder.call(half, given) for given in zip(*halves, strict=True)]
            builder.ret(builder.shuffle_vector(*both, _places(range(count))))
            continue
        function.attributes.add("noinline")
        a, b, c = (Value(builder, given) for given in function.args)
        found = _Sum(a, b, c)
        with builder.if_then(_all(builder, found.sure(), count), likely=True):
            builder.ret(found.result.value)
        result, sure = found.sure_at_last(a, b)
        with builder.if_then(_all(builder, sure, count), likely=True):
            builder.ret(result.value)
        builder.ret(_each(builder, general, function.args, count))
    return module


def _general(module: ir.Module) -> ir.Function:
    """Return a function that calls :func:`exactly`, which as numba compiles it writes its result into memory."""
    memory, numbers = ir.PointerType(DOUBLE), [DOUBLE] * 3
    exact = ir.Function(module, ir.FunctionType(ir.IntType(32), [memory, memory, *numbers]), EXACTLY)
    function = ir.Function(module, ir.FunctionType(DOUBLE, numbers), _GENERAL)
    builder = ir.IRBuilder(function.append_basic_block())
    result, error = builder.alloca(DOUBLE), builder.alloca(DOUBLE)
    builder.call(exact, [result, error, *function.args])
    builder.ret(builder.load(result, typ=DOUBLE))
    return function


def _places(places: Iterable[int]) -> ir.Constant:
    chosen = list(places)
    return ir.Constant(ir.VectorType(_PLACE, len(chosen)), chosen)


def _halves(builder: ir.IRBuilder, vector: ir.Value, count: int) -> list[ir.Value]:
    nothing = ir.Constant(vector.type, ir.Undefined)
    return [builder.shuffle_vector(vector, nothing, _places(range(i, i + count))) for i in (0, count)]


def _all(builder: ir.IRBuilder, mask: Value, count: int) -> ir.Value:
    if count == 1:
        return mask.value
    return functools.reduce(builder.and_, (builder.extract_element(mask.value, _PLACE(i)) for i in range(count)))


def _each(builder: ir.IRBuilder, function: ir.Function, given: Sequence[ir.Value], count: int) -> ir.Value:
    """Value of a function of numbers, for each of them."""
    if count == 1:
        return builder.call(function, given)
    whole: ir.Value = ir.Constant(given[0].type, ir.Undefined)
    for place in map(_PLACE, range(count)):
        one = builder.call(function, [builder.extract_element(vector, place) for vector in given])
        whole = builder.insert_element(whole, one, place)
    return whole
