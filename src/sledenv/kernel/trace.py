"""Straight-line programs written once in Python and compiled without a loop or a call in them.

A program may use arithmetic, the functions below and loops whose bounds are known beforehand. It is run once with
values that write LLVM instructions instead of computing: an unrolled recurrence of thousands of instructions then costs
no type inference, which is what takes numba long, and no loop stands between the processor and its order of execution.

:func:`compiled` makes a function of arrays of numbers, and :func:`abreast` one of arrays that hold ABREAST of each;
:func:`scalar` and :func:`packed` make one of numbers, or of arrays of them, and one that handles LANES of numbers side
by side. With vector instructions each lane goes through the same sequence of correctly rounded operations as a single
number does, so the results agree bit for bit.

With NUMBA_DISABLE_JIT the program runs as it stands; a fused multiply-add is then a multiplication and an addition.
"""

from __future__ import annotations

import copy
import inspect
import math
import operator
from collections.abc import Callable, Iterable, Sequence
from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils, config
from numba.extending import intrinsic

Program = Callable[..., None]

_LINE = 64  # bytes of cache
_ROOM = 4096  # places of an array that a function of numbers may use
LANES = 16  # two AVX-512 registers: while one of them waits for a result the other goes on
ABREAST = 8  # lanes of a program of arrays: what a long recurrence keeps in registers leaves room for one


class _Value:
    """A double, a vector of them or a mask in the function that is being written."""

    __slots__ = ("builder", "value")
    __array_ufunc__ = None  # an array times a value is the value's affair

    def __init__(self, builder: ir.IRBuilder, value: ir.Value) -> None:
        self.builder = builder
        self.value = value

    def lift(self, other: Any) -> ir.Value:
        """Return the LLVM value of a number, of an array of them or of a value."""
        if isinstance(other, _Value):
            return other.value
        kind = self.value.type
        if isinstance(kind, ir.VectorType):
            return ir.Constant(
                kind, [ir.Constant(ir.DoubleType(), float(n)) for n in np.broadcast_to(other, kind.count)]
            )
        return ir.Constant(kind, float(other))

    def _make(self, value: ir.Value) -> _Value:
        return type(self)(self.builder, value)

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


class _Lanes(_Value):
    """A number of each of the lanes, or a mask."""

    __slots__ = ()


class _Row:
    """A vector in each of the lanes: the numbers at its places, each of all lanes."""

    __slots__ = ("numbers",)
    __array_ufunc__ = None

    def __init__(self, numbers: Iterable[Any]) -> None:
        self.numbers = list(numbers)

    def __len__(self) -> int:
        return len(self.numbers)

    def __add__(self, other: Any) -> _Row:
        return _each(operator.add, self, other)

    def __radd__(self, other: Any) -> _Row:
        return _each(operator.add, other, self)

    def __sub__(self, other: Any) -> _Row:
        return _each(operator.sub, self, other)

    def __rsub__(self, other: Any) -> _Row:
        return _each(operator.sub, other, self)

    def __mul__(self, other: Any) -> _Row:
        return _each(operator.mul, self, other)

    def __rmul__(self, other: Any) -> _Row:
        return _each(operator.mul, other, self)

    def __truediv__(self, other: Any) -> _Row:
        return _each(operator.truediv, self, other)

    def __neg__(self) -> _Row:
        return _each(operator.neg, self)


class _Blank(float):
    """Zero that fills up a row."""


BLANK = _Blank()


def _each(function: Callable[..., Any], *operands: Any) -> _Row:
    """Apply a function place by place to rows, arrays and numbers that stand for a row of the same."""
    count = next(len(operand) for operand in operands if isinstance(operand, _Row))
    columns = [
        _numbers_of(operand) if isinstance(operand, _Row | np.ndarray) else [operand] * count for operand in operands
    ]
    return _Row(_filled(function, *numbers) for numbers in zip(*columns, strict=True))


def _filled(function: Callable[..., Any], *numbers: Any) -> Any:
    """Apply a function at a place of a row; nothing is computed where it is only filled up."""
    if any(isinstance(number, _Blank) for number in numbers):
        nothing = all(isinstance(number, float) and number == 0.0 for number in numbers)
        if function is operator.mul or (nothing and function in _IDLE):
            return BLANK
        if function is fma and any(isinstance(number, _Blank) for number in numbers[:2]):
            return numbers[2] + BLANK  # as a single lane adds the product
    return function(*numbers)


def _numbers_of(vector: _Row | np.ndarray) -> list[Any]:
    return vector.numbers if isinstance(vector, _Row) else vector.tolist()


def fma(a: Any, b: Any, c: Any) -> Any:
    """``a * b + c``, rounded once."""
    if any(isinstance(value, _Row) for value in (a, b, c)):
        return _each(fma, a, b, c)
    for value in (a, b, c):
        if isinstance(value, _Value):
            return value._make(value.lift(a)).call("llvm.fma", b, c)
    return a * b + c


def absolute(a: Any) -> Any:
    """Absolute value."""
    if isinstance(a, _Row):
        return _each(absolute, a)
    return a.call("llvm.fabs") if isinstance(a, _Value) else np.abs(a)


def with_sign(a: Any, b: Any) -> Any:
    """``a`` with the sign of ``b``."""
    return a.call("llvm.copysign", b) if isinstance(a, _Value) else np.copysign(a, b)


def nearest(a: Any) -> Any:
    """Round to the nearest integer, half to even."""
    return a.call("llvm.rint") if isinstance(a, _Value) else np.rint(a)


def root(a: Any) -> Any:
    """Square root; NaN for a negative number."""
    return a.call("llvm.sqrt") if isinstance(a, _Value) else np.sqrt(a)


def _compare(relation: str, a: Any, b: Any) -> Any:
    value = a if isinstance(a, _Value) else b
    return value._make(value.builder.fcmp_ordered(relation, value.lift(a), value.lift(b)))


def less(a: Any, b: Any) -> Any:
    """Mask of ``a < b``; false where one of them is not a number."""
    if isinstance(a, _Row) or isinstance(b, _Row):
        return _each(less, a, b)
    return _compare("<", a, b) if isinstance(a, _Value) or isinstance(b, _Value) else np.less(a, b)


def not_more(a: Any, b: Any) -> Any:
    """Mask of ``a <= b``; false where one of them is not a number."""
    if isinstance(a, _Row) or isinstance(b, _Row):
        return _each(not_more, a, b)
    return _compare("<=", a, b) if isinstance(a, _Value) or isinstance(b, _Value) else np.less_equal(a, b)


def where(mask: Any, then: Any, otherwise: Any) -> Any:
    """``then`` where a mask is true, else ``otherwise``."""
    if isinstance(mask, _Row):
        return _each(where, mask, then, otherwise)
    if not isinstance(mask, _Value):
        return np.where(mask, then, otherwise)[()]
    kind: Any = ir.DoubleType()
    if isinstance(mask.value.type, ir.VectorType):
        kind = ir.VectorType(kind, mask.value.type.count)
    zero = _Value(mask.builder, ir.Constant(kind, None))
    return mask._make(mask.builder.select(mask.value, zero.lift(then), zero.lift(otherwise)))


def where_less(a: Any, b: Any, then: Any, otherwise: Any) -> Any:
    """``then`` where ``a < b``, else ``otherwise``; also where one of them is not a number."""
    return where(less(a, b), then, otherwise)


def smaller(a: Any, b: Any) -> Any:
    """Return the smaller of two; ``b`` if one of them is not a number."""
    return where_less(a, b, a, b)


def larger(a: Any, b: Any) -> Any:
    """Return the larger of two; ``b`` if one of them is not a number."""
    if isinstance(a, _Row):
        return _each(larger, a, b)
    return where_less(b, a, a, b)


_IDLE = frozenset({operator.add, operator.sub, operator.neg, absolute, larger, fma})  # leave zeros as they are

_MANTISSA = 52  # bits
_BIAS = 1023


def rough_root(a: Any, n: Any) -> Any:
    """Root of order ``n`` > 13 of a positive number, less than .2 per cent too small; NaN for what is not finite."""
    if isinstance(a, _Row):
        return _each(rough_root, a, n)
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
    if not isinstance(a, _Value):
        return np.asarray(a).view(np.int64).astype(float)
    kind = a.value.type
    return a._make(a.builder.sitofp(a.builder.bitcast(a.value, _whole(kind)), kind))


def _of_bits(a: Any) -> Any:
    """Number whose bits are those of a whole number."""
    if not isinstance(a, _Value):
        return np.where(np.isfinite(a), a, 0.0).astype(np.int64).view(float)
    kind = a.value.type
    return a._make(a.builder.bitcast(a.builder.fptosi(a.value, _whole(kind)), kind))


def side_by_side(*numbers: Any) -> Any:
    """Vector of some numbers."""
    if any(isinstance(number, _Lanes) for number in numbers):
        return _Row(numbers)
    if not any(isinstance(number, _Value) for number in numbers):
        return np.array(numbers)
    builder = next(number.builder for number in numbers if isinstance(number, _Value))
    known = [0.0 if isinstance(number, _Value) else float(number) for number in numbers]
    kind = ir.DoubleType()
    vector: Any = ir.Constant(ir.VectorType(kind, len(numbers)), [ir.Constant(kind, number) for number in known])
    for i, number in enumerate(numbers):
        if isinstance(number, _Value):
            vector = builder.insert_element(vector, number.value, ir.Constant(ir.IntType(32), i))
    return _Value(builder, vector)


def repeated(number: Any, count: int) -> Any:
    """Vector of the same number."""
    return shuffled(side_by_side(number), None, [0] * count)


def shuffled(a: Any, b: Any, places: Sequence[int]) -> Any:
    """Vector of the elements of ``a`` and then ``b`` at some places; ``b`` may be None."""
    if isinstance(a, _Row) or isinstance(b, _Row):
        numbers = [number for vector in (a, b) if vector is not None for number in _numbers_of(vector)]
        return _Row(numbers[i] for i in places)
    if isinstance(b, _Value):
        a = _Value(b.builder, b.lift(a))
    if not isinstance(a, _Value):
        return (a if b is None else np.concatenate([a, b]))[list(places)]
    mask = ir.Constant(ir.VectorType(ir.IntType(32), len(places)), list(places))
    other = ir.Constant(a.value.type, ir.Undefined) if b is None else a.lift(b)
    return _Value(a.builder, a.builder.shuffle_vector(a.value, other, mask))


def filled_up(vector: Any, count: int) -> Any:
    """Vector of which all numbers but the first, so many, are known to be zero, and need not be computed with."""
    if not isinstance(vector, _Row):
        return vector
    return _Row([*vector.numbers[:count], *([BLANK] * (len(vector) - count))])


def blank(count: int, like: Any) -> Any:
    """Vector of zeros that fills up a row."""
    return _Row([BLANK] * count) if isinstance(like, _Row) else np.zeros(count)


def element(vector: Any, i: int) -> Any:
    """Number at a place of a vector."""
    if isinstance(vector, _Row):
        return vector.numbers[i]
    if not isinstance(vector, _Value):
        return vector[i]
    return _Value(vector.builder, vector.builder.extract_element(vector.value, ir.Constant(ir.IntType(32), i)))


def block(numbers: Any, first: int, count: int) -> Any:
    """Vector of consecutive numbers of an array."""
    if isinstance(numbers, _Section):
        return block(numbers.numbers, numbers.first + first, count)
    if not isinstance(numbers, _Numbers):
        return numbers[first : first + count].copy()
    if isinstance(numbers.kind, ir.VectorType):
        return _Row(numbers[i] for i in range(first, first + count))
    kind = ir.VectorType(ir.DoubleType(), count)
    place = numbers.builder.bitcast(numbers.place(first), ir.PointerType(kind))
    return _Value(numbers.builder, numbers.builder.load(place, align=8, typ=kind))


def without(numbers: Any, places: Iterable[int]) -> Any:
    """Array of lanes of which some places need not be written, because nobody reads them."""
    if isinstance(numbers, _Numbers):
        numbers = copy.copy(numbers)
        numbers.unread = frozenset(places)
    return numbers


class _Section:
    """What lies behind a place of an array."""

    def __init__(self, numbers: Any, first: int) -> None:
        self.numbers = numbers
        self.first = first

    def __getitem__(self, i: int) -> Any:
        return self.numbers[self.first + i]


def section(numbers: Any, first: int) -> Any:
    """Array that begins at a place of another."""
    return _Section(numbers, first) if isinstance(numbers, _Numbers) else numbers[first:]


def set_block(numbers: Any, first: int, vector: Any) -> None:
    """Write a vector to consecutive places of an array."""
    if isinstance(numbers, _Numbers) and isinstance(numbers.kind, ir.VectorType):
        for i, number in enumerate(_numbers_of(vector)):
            numbers[first + i] = number
    elif isinstance(numbers, _Numbers):
        kind = ir.VectorType(
            ir.DoubleType(), len(vector) if isinstance(vector, np.ndarray) else vector.value.type.count
        )
        value = _Value(numbers.builder, ir.Constant(kind, None)).lift(vector)
        numbers.builder.store(value, numbers.builder.bitcast(numbers.place(first), ir.PointerType(kind)), align=8)
        for i in range(first, first + kind.count):
            numbers.known.pop(i, None)
    else:
        numbers[first : first + len(vector)] = vector


# Sums of eight vectors of eight at once: each step adds two halves of which neither leaves its 128 bits until it must.
_FOLDS = (
    ((0, 8, 2, 10, 4, 12, 6, 14), (1, 9, 3, 11, 5, 13, 7, 15)),
    ((0, 1, 8, 9, 4, 5, 12, 13), (2, 3, 10, 11, 6, 7, 14, 15)),
    ((0, 1, 2, 3, 8, 9, 10, 11), (4, 5, 6, 7, 12, 13, 14, 15)),
)


def sums(vectors: Sequence[Any]) -> list[Any]:
    """Sum of the elements of each of some vectors of eight."""
    found = []
    for first in range(0, len(vectors), 8):
        part = list(vectors[first : first + 8])
        count = len(part)
        part += [part[0]] * (8 - count)
        for low, high in _FOLDS:
            part = [shuffled(a, b, low) + shuffled(a, b, high) for a, b in zip(part[::2], part[1::2], strict=True)]
        found += [element(part[0], i) for i in range(count)]
    return found


class _Numbers:
    """An array in the function that is being written, of doubles or of vectors of them; each is loaded once."""

    def __init__(self, builder: ir.IRBuilder, data: ir.Value, kind: ir.Type) -> None:
        self.builder = builder
        self.data = data if isinstance(kind, ir.DoubleType) else builder.bitcast(data, ir.PointerType(kind))
        self.kind = kind
        self.of: type[_Value] = _Lanes if isinstance(kind, ir.VectorType) else _Value
        self.known: dict[int, Any] = {}
        self.unread: frozenset[int] = frozenset()

    def place(self, i: int) -> ir.Value:
        """Pointer to an entry."""
        return self.builder.gep(self.data, [ir.Constant(ir.IntType(64), i)], source_etype=self.kind)

    def __getitem__(self, i: int) -> Any:
        if i not in self.known:
            self.known[i] = self.of(self.builder, self.builder.load(self.place(i), align=8, typ=self.kind))
        return self.known[i]

    def __setitem__(self, i: int, value: Any) -> None:
        zero = _Value(self.builder, ir.Constant(self.kind, None))
        self.known[i] = value if isinstance(value, _Blank) else self.of(self.builder, zero.lift(value))
        if i in self.unread or isinstance(value, _Blank):
            return
        self.builder.store(self.known[i].value, self.place(i), align=8)


def _numbers(context: Any, builder: Any, of: Any, argument: Any, kind: ir.Type | None = None) -> _Numbers:
    """Array that a kernel hands to a program."""
    return _Numbers(builder, context.make_array(of)(context, builder, argument).data, kind or ir.DoubleType())


def compiled(program: Program) -> Callable[..., None]:
    """Return a function of arrays that runs a program, for use in kernels, which compile it.

    Each call in a kernel writes the program into it: call it in one kernel of its own.

    Parameters
    ----------
    program : callable
        Of indexed objects: it reads and writes numbers of ``z`` and of ``c``, say, counted in the order of memory.

    Returns
    -------
    callable
        Of as many contiguous arrays of any shape.
    """
    if config.DISABLE_JIT:  # type: ignore[attr-defined]

        def interpreted(*arrays: np.ndarray) -> None:
            with np.errstate(all="ignore"):
                program(*(array.reshape(-1) for array in arrays))

        return interpreted

    return _straight(program, ir.DoubleType())


def abreast(program: Program) -> Callable[..., None]:
    """Return what :func:`compiled` does, but of arrays with ABREAST lanes: shape (numbers, ABREAST) each.

    A vector of the program is one number after the other here, and each number a vector of the lanes.
    """
    if config.DISABLE_JIT:  # type: ignore[attr-defined]

        def interpreted(*arrays: np.ndarray) -> None:
            with np.errstate(all="ignore"):
                for lane in range(ABREAST):
                    columns = [array[:, lane].copy() for array in arrays]
                    program(*columns)
                    for array, column in zip(arrays, columns, strict=True):
                        array[:, lane] = column

        return interpreted

    return _straight(program, ir.VectorType(ir.DoubleType(), ABREAST))


def _straight(program: Program, kind: ir.Type) -> Callable[..., None]:
    def straight(typing_context: Any, *arrays: Any) -> Any:
        def write(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            # Or vectors that are kept on the stack would lie across two lines.
            builder.function.attributes.add("nounwind")  # llvmlite heeds the alignment beside another attribute only
            builder.function.attributes.alignstack = _LINE
            given = zip(signature.args, arguments, strict=True)
            program(*(_numbers(context, builder, *array, kind) for array in given))
            return context.get_dummy_value()

        return types.void(*arrays), write

    return cast(Callable[..., None], _intrinsic_like(program, straight))


if config.DISABLE_JIT:  # type: ignore[attr-defined]

    def set_apart() -> None:
        """Keep the kernel that calls this out of its callers."""

else:

    @intrinsic
    def set_apart(typing_context: Any) -> Any:
        """Keep the kernel that calls this out of its callers."""

        def write(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            builder.function.attributes.add("noinline")
            return context.get_dummy_value()

        return types.void(), write


def _intrinsic_like(function: Callable[..., Any], straight: Any) -> Any:
    """Return an intrinsic function with the arguments of a program: numba looks for their names."""
    context = inspect.Parameter("typing_context", inspect.Parameter.POSITIONAL_OR_KEYWORD)
    names = (context, *inspect.signature(function).parameters.values())
    straight.__signature__ = inspect.Signature(names)
    return intrinsic(straight)


def scalar(function: Callable[..., tuple[Any, ...]]) -> Callable[..., tuple[float, ...]]:
    """Return a function of floats, and of arrays of them, that runs a program, for use in kernels, which compile it."""
    if config.DISABLE_JIT:  # type: ignore[attr-defined]

        def interpreted(*numbers: Any) -> tuple[float, ...]:
            with np.errstate(all="ignore"):
                return function(*(n.reshape(-1) if isinstance(n, np.ndarray) else np.float64(n) for n in numbers))

        return interpreted

    def straight(typing_context: Any, *numbers: Any) -> Any:
        kinds = tuple(number if isinstance(number, types.Array) else types.float64 for number in numbers)
        results = len(function(*(np.full(_ROOM, math.nan) if isinstance(n, types.Array) else math.nan for n in kinds)))

        def write(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            values: list[Any] = [
                _numbers(context, builder, of, argument) if isinstance(of, types.Array) else _Value(builder, argument)
                for of, argument in zip(signature.args, arguments, strict=True)
            ]
            zero = _Value(builder, ir.Constant(ir.DoubleType(), None))
            found = [zero.lift(value) for value in function(*values)]
            return context.make_tuple(builder, signature.return_type, found)

        returned: Any = types.UniTuple(types.float64, results)  # type: ignore[no-untyped-call]
        return returned(*kinds), write

    return cast(Callable[..., tuple[float, ...]], _intrinsic_like(function, straight))


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


def _halved(coefficients: Sequence[float], x: Any) -> Any:
    """Value of a polynomial with eight coefficients, by halves that are evaluated side by side."""
    square = x * x
    twos = [fma(x, b, a) for a, b in zip(coefficients[::2], coefficients[1::2], strict=True)]
    fours = [fma(square, b, a) for a, b in zip(twos[::2], twos[1::2], strict=True)]
    return fma(square * square, fours[1], fours[0])


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


def sine_cosine(angle: Any) -> tuple[Any, Any]:
    """Sine and cosine of an angle within a few turns of zero, to 1 ulp or two: Taylor series on [-pi/4, pi/4]."""
    quarter = nearest(angle * (2.0 / math.pi))
    # pi/2 in three parts, of which the first two are exact in 33 bits (Cody and Waite).
    x = fma(quarter, -1.57079632673412561417e00, angle)
    x = fma(quarter, -6.07710050630396597660e-11, x)
    x = fma(quarter, -2.02226624879595063154e-21, x)
    square = x * x
    odd = _halved([(-1.0) ** k / math.factorial(2 * k + 1) for k in range(1, 9)], square)
    even = _halved([(-1.0) ** k / math.factorial(2 * k) for k in range(1, 9)], square)
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
