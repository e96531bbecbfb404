"""Straight-line programs, written once in Python and compiled without a loop or a call in them.

A program may use arithmetic, the functions of :mod:`sledenv.compiler.values` and of :mod:`sledenv.compiler.rows`, and
loops whose bounds are known beforehand. It is run once, with values that write LLVM instructions instead of computing.
An unrolled recurrence of thousands of instructions then costs no type inference, which is what takes numba long, and
the processor finds many instructions that do not wait for each other.

A program is given records and knows their fields by name: ``step.length`` loads a field, ``step.length = 2.0`` stores
one. A field holds a number, or a series of them. :func:`straight` makes a function of records, :func:`scalar` one of
numbers. A named tuple of numbers is read like a record.

With NUMBA_DISABLE_JIT the program runs as it stands; a fused multiply-add is then a multiplication and an addition.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np
from llvmlite import ir

from sledenv.compiler.jit import kernel, when_compiled
from sledenv.compiler.values import DOUBLE, Value, constant

Program = Callable[..., None]

_LINE = 64  # bytes of cache
_ROOM = 64  # numbers of a series that a function of numbers may look at


# What programs are given.


class Series:
    """Consecutive numbers in memory, in the function that is being written; each is loaded once."""

    def __init__(self, builder: ir.IRBuilder, data: ir.Value) -> None:
        self._builder = builder
        self._data = builder.bitcast(data, ir.PointerType(DOUBLE))
        self._known: dict[int, Value] = {}

    def _place(self, i: int, kind: ir.Type) -> ir.Value:
        place = self._builder.gep(self._data, [ir.Constant(ir.IntType(64), i)], source_etype=DOUBLE)
        return self._builder.bitcast(place, ir.PointerType(kind))

    def __getitem__(self, i: int) -> Value:
        if i not in self._known:
            self._known[i] = Value(self._builder, self._builder.load(self._place(i, DOUBLE), align=8, typ=DOUBLE))
        return self._known[i]

    def block(self, first: int, count: int) -> Value:
        """Load a vector of consecutive numbers."""
        kind = ir.VectorType(DOUBLE, count)
        return Value(self._builder, self._builder.load(self._place(first, kind), align=8, typ=kind))

    def write(self, blocks: Sequence[Any]) -> None:
        """Overwrite all numbers by vectors, one behind the other."""
        self._known.clear()
        first = 0
        for vector in blocks:
            count = len(vector) if isinstance(vector, np.ndarray) else vector.value.type.count
            kind = ir.VectorType(DOUBLE, count)
            value = vector.value if isinstance(vector, Value) else constant(kind, vector)
            self._builder.store(value, self._place(first, kind), align=8)
            first += count


def block(numbers: Any, first: int, count: int) -> Any:
    """Vector of consecutive numbers of a series."""
    return numbers.block(first, count) if isinstance(numbers, Series) else numbers[first : first + count].copy()


def write_series(numbers: Any, blocks: Sequence[Any]) -> None:
    """Overwrite the numbers of a series by vectors, one behind the other."""
    if isinstance(numbers, Series):
        numbers.write(blocks)
    else:
        joined = np.concatenate(blocks)
        numbers[: len(joined)] = joined


class _Fields:
    """A record in the function that is being written.

    Reading an attribute loads the field of that name, once; setting one stores it. A field is a number, or a series,
    which is set to a list of vectors.
    """

    def __init__(self, builder: ir.IRBuilder, data: ir.Value, record: Any) -> None:
        # Past __setattr__, which stores.
        self.__dict__.update(_builder=builder, _data=data, _record=record, _known={})

    def _place(self, name: str) -> ir.Value:
        byte = ir.IntType(8)
        data = self._builder.bitcast(self._data, ir.PointerType(byte))
        return self._builder.gep(data, [ir.Constant(ir.IntType(64), self._record.offset(name))], source_etype=byte)

    def _records(self, name: str, of: Any) -> list[_Fields]:
        """Records of an array of them."""
        found = []
        for i in range(of.shape[0]):
            byte = ir.IntType(8)
            place = self._builder.gep(
                self._place(name), [ir.Constant(ir.IntType(64), i * of.dtype.size)], source_etype=byte
            )
            found.append(_Fields(self._builder, place, of.dtype))
        return found

    def __getattr__(self, name: str) -> Any:
        from numba import types

        if name not in self._known:
            of: Any = self._record.typeof(name)
            if isinstance(of, types.Record):
                self._known[name] = _Fields(self._builder, self._place(name), of)
            elif isinstance(of, types.NestedArray) and isinstance(of.dtype, types.Record):
                self._known[name] = self._records(name, of)
            elif isinstance(of, types.NestedArray):
                self._known[name] = Series(self._builder, self._place(name))
            else:
                place = self._builder.bitcast(self._place(name), ir.PointerType(DOUBLE))
                loaded = self._builder.load(place, align=8, typ=DOUBLE)
                self._known[name] = Value(self._builder, loaded)
        return self._known[name]

    def __setattr__(self, name: str, value: Any) -> None:
        if isinstance(value, list):
            getattr(self, name).write(value)
            return
        lifted = value.value if isinstance(value, Value) else constant(DOUBLE, value)
        self._known[name] = Value(self._builder, lifted)
        place = self._builder.bitcast(self._place(name), ir.PointerType(DOUBLE))
        self._builder.store(lifted, place, align=8)


class _Interpreted:
    """A record for a program that runs as it stands."""

    def __init__(self, record: Any) -> None:
        self.__dict__["_record"] = record

    def __getattr__(self, name: str) -> Any:
        field = self._record[name]
        if isinstance(field, np.ndarray) and field.dtype.names:
            return [_Interpreted(one) for one in field]
        return _Interpreted(field) if isinstance(field, np.void) else field

    def __setattr__(self, name: str, value: Any) -> None:
        self._record[name] = (
            np.concatenate(value).reshape(self._record[name].shape) if isinstance(value, list) else value
        )


def _tuple(kind: type[Any], numbers: Iterable[Any]) -> Any:
    """Return a named tuple of what a program computes with; the kind itself may take plain floats alone."""
    return tuple.__new__(kind, numbers)


def _as_it_stands(given: Any) -> Any:
    """What a program that runs as it stands gets for an argument."""
    if hasattr(given, "_make"):
        return _tuple(type(given), map(np.float64, given))
    return _Interpreted(given) if isinstance(given, np.void) else given


def _as_values(context: Any, builder: Any, kind: Any, argument: Any) -> Any:
    """What a program that is being compiled gets for an argument."""
    from numba import types

    if isinstance(kind, types.Record):
        return _Fields(builder, argument, kind)
    if hasattr(kind, "instance_class"):
        numbers = (builder.extract_value(argument, i) for i in range(len(kind)))
        doubles = (builder.sitofp(n, DOUBLE) if isinstance(n.type, ir.IntType) else n for n in numbers)
        return _tuple(kind.instance_class, (Value(builder, number) for number in doubles))
    if isinstance(kind, types.Array):
        return Series(builder, context.make_array(kind)(context, builder, argument).data)
    return Value(builder, argument)


class _Unknown(float):
    """A number, or a record of them, of a program that only shows how many answers it has."""

    def __getattr__(self, name: str) -> _Unknown:
        return _Unknown(math.nan)

    def __iter__(self) -> Iterator[_Unknown]:
        return iter((self, self))  # arrays of records have two

    def __getitem__(self, i: int) -> _Unknown:
        return self


def _unknown(kind: Any) -> Any:
    """What a program that only shows how many answers it has gets for an argument."""
    from numba import types

    number = _Unknown(math.nan)
    if hasattr(kind, "instance_class"):
        return _tuple(kind.instance_class, [number] * len(kind))
    return np.full(_ROOM, number) if isinstance(kind, types.Array) else number


# How programs are compiled.


def _written_out(
    run: Callable[..., Any],
    like: Callable[..., Any],
    write: Callable[..., Any],
    count: Callable[[tuple[Any, ...]], int] | None = None,
) -> None:
    """Let compiled code contain, in place of a call of ``run``, what ``write`` writes there.

    It takes arguments ``like`` another function; numba looks for their names. ``count`` gives how many doubles it
    returns for arguments of some kinds; without it nothing is returned.
    """

    def register() -> None:
        from numba import types
        from numba.extending import lower_builtin, type_callable

        def typed(typing_context: Any) -> Any:
            def returned(*given: Any) -> Any:
                if count is None:
                    return types.void(*given)
                kinds = tuple(types.float64 if isinstance(kind, types.Number) else kind for kind in given)
                several: Any = types.UniTuple(types.float64, count(kinds))  # type: ignore[no-untyped-call]
                return several(*kinds)

            returned.__signature__ = inspect.signature(like)  # type: ignore[attr-defined]
            return returned

        type_callable(run)(typed)
        any_arguments = types.VarArg(types.Any)  # type: ignore[no-untyped-call]
        lower_builtin(run, any_arguments)(write)  # type: ignore[no-untyped-call]

    when_compiled(register)


def straight(program: Program) -> Callable[..., None]:
    """Return a function that runs a program of records, for use in kernels, which compile it.

    Each call in a kernel writes the whole program into it: call it in one kernel of its own.
    """

    def run(*given: Any) -> None:
        with np.errstate(all="ignore"):
            program(*map(_as_it_stands, given))

    def write(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        # Or vectors that are kept on the stack would lie across two lines.
        builder.function.attributes.add("nounwind")  # llvmlite heeds the alignment beside another attribute only
        builder.function.attributes.alignstack = _LINE
        given = zip(signature.args, arguments, strict=True)
        program(*(_as_values(context, builder, kind, argument) for kind, argument in given))
        return context.get_dummy_value()

    _written_out(run, program, write)
    return run


def of_point(program: Program) -> Callable[[np.void, np.void, np.void], None]:
    """Return a kernel of its own that runs a program of a contact, a point of it and its step."""
    run = straight(program)

    @kernel
    def whole(contact: np.void, point: np.void, step: np.void) -> None:
        run(contact, point, step)

    return whole


def scalar(function: Callable[..., tuple[Any, ...]]) -> Callable[..., tuple[float, ...]]:
    """Return a function of numbers, series and records that runs a program, for use in kernels, which compile it.

    Series are contiguous arrays of doubles that are read, and may be written as a whole: see :func:`write_series`.
    """

    def run(*numbers: Any) -> tuple[float, ...]:
        with np.errstate(all="ignore"):
            return function(*(np.float64(n) if isinstance(n, int | float) else _as_it_stands(n) for n in numbers))

    def write(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        given = zip(signature.args, arguments, strict=True)
        zero = Value(builder, ir.Constant(DOUBLE, None))
        values = function(*(_as_values(context, builder, kind, argument) for kind, argument in given))
        return context.make_tuple(builder, signature.return_type, [zero.lift(value) for value in values])

    _written_out(run, function, write, lambda kinds: len(function(*map(_unknown, kinds))))
    return run


def _run_inlined() -> None:
    pass


def _inline(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    builder.function.attributes.add("alwaysinline")
    return context.get_dummy_value()


# Called in a kernel: LLVM copies it into its callers. Of the box rule alone, whose many arguments take longer to hand
# over: rigid impacts are 8 % faster so, and nothing else gains.
copy_into_callers = _run_inlined
_written_out(copy_into_callers, copy_into_callers, _inline)
