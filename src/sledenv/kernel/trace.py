"""Straight-line programs, written once in Python and compiled without a loop or a call in them.

A program may use arithmetic, the functions below and loops whose bounds are known beforehand. It is run once, with
values that write LLVM instructions instead of computing. An unrolled recurrence of thousands of instructions then costs
no type inference, which is what takes numba long, and the processor finds many instructions that do not wait for each
other.

A program is given records and knows their fields by name: ``step.length`` loads a field, ``step.length = 2.0`` stores
one. :func:`straight` makes a function of records that hold one number in a field, or a series of them. :func:`packed`
makes one of records whose every field holds LANES numbers, one of each lane: the same text then works on all lanes at
once, with vector instructions. Each lane goes through the same correctly rounded operations as a single number does, so
the results agree bit for bit. :func:`scalar` makes a function of numbers.

With NUMBA_DISABLE_JIT the program runs as it stands; a fused multiply-add is then a multiplication and an addition.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Sequence
from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.core import cgutils
from numba.extending import intrinsic

Program = Callable[..., None]

LANES = 16  # of a pack: two AVX-512 registers; while one of them waits for a result the other goes on
_LINE = 64  # bytes of cache
_DOUBLE = ir.DoubleType()
_ROOM = 64  # numbers of a series that a function of numbers may look at


class Value:
    """A double, a vector of them or a mask in the function that is being written."""

    __slots__ = ("builder", "value")
    __array_ufunc__ = None  # an array times a value is the value's affair

    def __init__(self, builder: ir.IRBuilder, value: ir.Value) -> None:
        self.builder = builder
        self.value = value

    def lift(self, other: Any) -> ir.Value:
        """Return the LLVM value of a number, of an array of them or of a value."""
        return other.value if isinstance(other, Value) else _constant(self.value.type, other)

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
        write: Any = cgutils.get_or_insert_function
        function = write(self.builder.module, signature, f"{name}.{suffix}")
        return self.make(self.builder.call(function, [self.value, *(self.lift(other) for other in others)]))


def _constant(kind: Any, number: Any) -> ir.Value:
    """LLVM constant of a number, or of an array of them."""
    if isinstance(kind, ir.VectorType):
        return ir.Constant(kind, [ir.Constant(_DOUBLE, float(n)) for n in np.broadcast_to(number, kind.count)])
    return ir.Constant(kind, float(number))


# What programs compute with.


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
    kind: Any = _DOUBLE
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


# Vectors of the numbers of one lane.


def side_by_side(*numbers: Any) -> Any:
    """Vector of some numbers."""
    builder = next((number.builder for number in numbers if isinstance(number, Value)), None)
    if builder is None:
        return np.array(numbers)
    known = [0.0 if isinstance(number, Value) else float(number) for number in numbers]
    vector: Any = _constant(ir.VectorType(_DOUBLE, len(numbers)), known)
    for i, number in enumerate(numbers):
        if isinstance(number, Value):
            vector = builder.insert_element(vector, number.value, ir.Constant(ir.IntType(32), i))
    return Value(builder, vector)


def repeated(number: Any, count: int) -> Any:
    """Vector of the same number."""
    return shuffled(side_by_side(number), None, [0] * count)


def shuffled(a: Any, b: Any, places: Sequence[int]) -> Any:
    """Vector of the elements of ``a`` and then ``b`` at some places; ``b`` may be None."""
    if isinstance(b, Value):
        a = Value(b.builder, b.lift(a))
    if not isinstance(a, Value):
        return (a if b is None else np.concatenate([a, b]))[list(places)]
    mask = ir.Constant(ir.VectorType(ir.IntType(32), len(places)), list(places))
    other = ir.Constant(a.value.type, ir.Undefined) if b is None else a.lift(b)
    return a.make(a.builder.shuffle_vector(a.value, other, mask))


def element(vector: Any, i: int) -> Any:
    """Number at a place of a vector."""
    if not isinstance(vector, Value):
        return vector[i]
    return vector.make(vector.builder.extract_element(vector.value, ir.Constant(ir.IntType(32), i)))


def block(numbers: Any, first: int, count: int) -> Any:
    """Vector of consecutive numbers of a series."""
    return numbers.block(first, count) if isinstance(numbers, Series) else numbers[first : first + count].copy()


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


# What programs are given.


class Series:
    """Consecutive numbers in memory, in the function that is being written; each is loaded once."""

    def __init__(self, builder: ir.IRBuilder, data: ir.Value) -> None:
        self._builder = builder
        self._data = builder.bitcast(data, ir.PointerType(_DOUBLE))
        self._known: dict[int, Value] = {}

    def _place(self, i: int, kind: ir.Type) -> ir.Value:
        place = self._builder.gep(self._data, [ir.Constant(ir.IntType(64), i)], source_etype=_DOUBLE)
        return self._builder.bitcast(place, ir.PointerType(kind))

    def __getitem__(self, i: int) -> Value:
        if i not in self._known:
            self._known[i] = Value(self._builder, self._builder.load(self._place(i, _DOUBLE), align=8, typ=_DOUBLE))
        return self._known[i]

    def block(self, first: int, count: int) -> Value:
        """Load a vector of consecutive numbers."""
        kind = ir.VectorType(_DOUBLE, count)
        return Value(self._builder, self._builder.load(self._place(first, kind), align=8, typ=kind))

    def write(self, blocks: Sequence[Any]) -> None:
        """Overwrite all numbers by vectors, one behind the other."""
        self._known.clear()
        first = 0
        for vector in blocks:
            count = len(vector) if isinstance(vector, np.ndarray) else vector.value.type.count
            kind = ir.VectorType(_DOUBLE, count)
            value = vector.value if isinstance(vector, Value) else _constant(kind, vector)
            self._builder.store(value, self._place(first, kind), align=8)
            first += count


class _Fields:
    """A record in the function that is being written.

    Reading an attribute loads the field of that name, once; setting one stores it. A field is a number, or as many as
    there are lanes. In a record of one lane it may also be a series, which is set to a list of vectors.
    """

    def __init__(self, builder: ir.IRBuilder, data: ir.Value, record: Any, lanes: int) -> None:
        kind = ir.VectorType(_DOUBLE, lanes) if lanes > 1 else _DOUBLE
        # Past __setattr__, which stores.
        self.__dict__.update(_builder=builder, _data=data, _record=record, _lanes=lanes, _kind=kind, _known={})

    def _place(self, name: str) -> ir.Value:
        byte = ir.IntType(8)
        data = self._builder.bitcast(self._data, ir.PointerType(byte))
        return self._builder.gep(data, [ir.Constant(ir.IntType(64), self._record.offset(name))], source_etype=byte)

    def __getattr__(self, name: str) -> Any:
        if name not in self._known:
            of: Any = self._record.typeof(name)
            if isinstance(of, types.NestedArray) and of.shape != (self._lanes,):
                self._known[name] = Series(self._builder, self._place(name))
            else:
                place = self._builder.bitcast(self._place(name), ir.PointerType(self._kind))
                loaded = self._builder.load(place, align=8, typ=self._kind)
                self._known[name] = Value(self._builder, loaded)
        return self._known[name]

    def __setattr__(self, name: str, value: Any) -> None:
        if isinstance(value, list):
            getattr(self, name).write(value)
            return
        lifted = value.value if isinstance(value, Value) else _constant(self._kind, value)
        self._known[name] = Value(self._builder, lifted)
        place = self._builder.bitcast(self._place(name), ir.PointerType(self._kind))
        self._builder.store(lifted, place, align=8)


class _Interpreted:
    """A record for a program that runs as it stands."""

    def __init__(self, record: Any) -> None:
        self.__dict__["_record"] = record

    def __getattr__(self, name: str) -> Any:
        field = self._record[name]
        # A copy, or the old number would change with the new one; but a series can be written.
        return field.copy() if isinstance(field, np.ndarray) and len(field) == LANES else field

    def __setattr__(self, name: str, value: Any) -> None:
        self._record[name] = np.concatenate(value) if isinstance(value, list) else value


# How programs are compiled.


def straight(program: Program) -> Callable[..., None]:
    """Return a function that runs a program of records, for use in kernels, which compile it.

    Each call in a kernel writes the whole program into it: call it in one kernel of its own.
    """
    return _of_records(program, 1)


def packed(program: Program) -> Callable[..., None]:
    """Return a function that runs a program of packs, for use in kernels, which compile it; see :func:`pack_of`."""
    return _of_records(program, LANES)


def pack_of(record: np.dtype) -> np.dtype:
    """Return the type of a pack: a record with the same fields, each of LANES numbers."""
    return np.dtype([(name, "f8", (LANES,)) for name in record.names or ()], align=True)


def _of_records(program: Program, lanes: int) -> Callable[..., None]:
    if config.DISABLE_JIT:  # type: ignore[attr-defined]

        def interpreted(*records: Any) -> None:
            with np.errstate(all="ignore"):
                program(*(_Interpreted(record) for record in records))

        return interpreted

    def typed(typing_context: Any, *records: Any) -> Any:
        def write(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            # Or vectors that are kept on the stack would lie across two lines.
            builder.function.attributes.add("nounwind")  # llvmlite heeds the alignment beside another attribute only
            builder.function.attributes.alignstack = _LINE
            given = zip(signature.args, arguments, strict=True)
            program(*(_Fields(builder, data, record, lanes) for record, data in given))
            return context.get_dummy_value()

        return types.void(*records), write

    return cast(Callable[..., None], _intrinsic_like(program, typed))


def scalar(function: Callable[..., tuple[Any, ...]]) -> Callable[..., tuple[float, ...]]:
    """Return a function of numbers, and of series of them, that runs a program, for use in kernels, which compile it.

    Series are contiguous arrays of doubles that are read, and may be written as a whole: see :func:`write_series`.
    """
    if config.DISABLE_JIT:  # type: ignore[attr-defined]

        def interpreted(*numbers: Any) -> tuple[float, ...]:
            with np.errstate(all="ignore"):
                return function(*(n if isinstance(n, np.ndarray) else np.float64(n) for n in numbers))

        return interpreted

    def typed(typing_context: Any, *numbers: Any) -> Any:
        kinds = tuple(number if isinstance(number, types.Array) else types.float64 for number in numbers)
        results = len(function(*(np.full(_ROOM, math.nan) if isinstance(n, types.Array) else math.nan for n in kinds)))

        def write(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            values: list[Any] = [
                Series(builder, context.make_array(of)(context, builder, argument).data)
                if isinstance(of, types.Array)
                else Value(builder, argument)
                for of, argument in zip(signature.args, arguments, strict=True)
            ]
            zero = Value(builder, ir.Constant(_DOUBLE, None))
            found = [zero.lift(value) for value in function(*values)]
            return context.make_tuple(builder, signature.return_type, found)

        returned: Any = types.UniTuple(types.float64, results)  # type: ignore[no-untyped-call]
        return returned(*kinds), write

    return cast(Callable[..., tuple[float, ...]], _intrinsic_like(function, typed))


def write_series(numbers: Any, blocks: Sequence[Any]) -> None:
    """Overwrite the numbers of a series by vectors, one behind the other."""
    if isinstance(numbers, Series):
        numbers.write(blocks)
    else:
        joined = np.concatenate(blocks)
        numbers[: len(joined)] = joined


def _attribute(name: str) -> Callable[[], None]:
    """Return a function that gives the kernel in which it is called an attribute of LLVM's."""
    if config.DISABLE_JIT:  # type: ignore[attr-defined]
        return lambda: None

    def typed(typing_context: Any) -> Any:
        def write(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            builder.function.attributes.add(name)
            return context.get_dummy_value()

        return types.void(), write

    return cast(Callable[[], None], intrinsic(typed))


# Called in a kernel: keep its code out of its callers, because many call it where speed does not matter; or copy it
# into them, because handing over its many arguments takes longer than it does.
keep_apart = _attribute("noinline")
copy_into_callers = _attribute("alwaysinline")


def _intrinsic_like(function: Callable[..., Any], typed: Any) -> Any:
    """Return an intrinsic function with the arguments of a program: numba looks for their names."""
    context = inspect.Parameter("typing_context", inspect.Parameter.POSITIONAL_OR_KEYWORD)
    names = (context, *inspect.signature(function).parameters.values())
    typed.__signature__ = inspect.Signature(names)
    return intrinsic(typed)
