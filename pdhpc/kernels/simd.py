"""An explicit SIMD value for numba: F64x8, eight doubles that go through a kernel together.

LLVM lowers the eight lanes to whatever the processor has (one AVX-512 register, two of AVX2, four of SSE2); every operation is IEEE-exact and done lane by lane
in a fixed order, so results have the same bits on all of them that have fused multiply-add. Values exist inside kernels only. In a kernel,

    from pdhpc.kernels.simd import fma, gather_xy, lane_mask, lane_sum, select, splat, sqrt8

    total = splat(0.0)
    for k in range(first, last, 8):                      # rows are padded to whole blocks of eight
        x, y = gather_xy(position, neighbour, k)         # rows neighbour[k] ... neighbour[k + 7] of position (n, 2)
        ex, ey = x - px, y - py                          # + - * / take vectors and floats, in any mix
        length = sqrt8(ex * ex + ey * ey)
        live = lane_mask(alive[k >> 3])                  # a byte as eight truth values
        total = fma(select(live, length, splat(0.0)), ex, total)
    result = lane_sum(total)

`min` and `math.exp` take vectors too, so that a material's law is written once and serves floats and vectors alike.
"""
import math
import operator
import os
import platform

from llvmlite import binding, ir
from numba.core import cgutils, types
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

LANES = 8
CHOICES = ("vector", "reference")
"""What the environment variable PDHPC_KERNELS may hold."""

_DOUBLE, _I32 = ir.DoubleType(), ir.IntType(32)
_VECTOR = ir.VectorType(_DOUBLE, LANES)
_MASK = ir.VectorType(ir.IntType(1), LANES)


class _F64x8Type(types.Type):
    def __init__(self):
        super().__init__(name="F64x8")


class _Mask8Type(types.Type):
    def __init__(self):
        super().__init__(name="Mask8")


F64x8, Mask8 = _F64x8Type(), _Mask8Type()


@register_model(_F64x8Type)
class _F64x8Model(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _VECTOR)


@register_model(_Mask8Type)
class _Mask8Model(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _MASK)


def chosen():
    """Return whether kernels use vectors: as PDHPC_KERNELS says, else wherever eight fused multiply-adds are fast (on x86: AVX2 and FMA). Local.

    Ask once, at import, and choose between two functions by the answer: numba's cache would not notice a change of it inside of one function.

    Raises
    ------
    ValueError: PDHPC_KERNELS holds another word.
    """
    choice = os.environ.get("PDHPC_KERNELS")
    if choice is None:
        features = binding.get_host_cpu_features()
        return platform.machine() not in ("x86_64", "AMD64") or bool(features.get("avx2") and features.get("fma"))
    if choice not in CHOICES:
        raise ValueError(f"PDHPC_KERNELS={choice}: must be one of {', '.join(CHOICES)}")
    return choice == "vector"


def _lanes(indices):
    return ir.Constant(ir.VectorType(_I32, len(indices)), list(indices))


def _splat(builder, value):
    """Return a vector with `value` (double) in every lane."""
    vector = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), value, ir.Constant(_I32, 0))
    return builder.shuffle_vector(vector, ir.Constant(_VECTOR, ir.Undefined), _lanes([0] * LANES))


def _as_vector(builder, kind, value):
    return value if kind is F64x8 or kind == F64x8 else _splat(builder, value)


_PAIRS = [(F64x8, F64x8), (F64x8, types.float64), (types.float64, F64x8)]


def _define_operator(function, instruction):
    """Let a Python operator take vectors and floats in any mix."""

    @infer_global(function)
    class _Typing(ConcreteTemplate):
        cases = [signature(F64x8, *pair) for pair in _PAIRS]

    def lower(context, builder, signature, arguments):
        a, b = (_as_vector(builder, kind, value) for kind, value in zip(signature.args, arguments))
        return getattr(builder, instruction)(a, b)

    for pair in _PAIRS:
        lower_builtin(function, *pair)(lower)


for _function, _instruction in ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul"), (operator.truediv, "fdiv")):
    _define_operator(_function, _instruction)


@infer_global(operator.gt)
class _GreaterTyping(ConcreteTemplate):
    cases = [signature(Mask8, *pair) for pair in _PAIRS]


def _lower_greater(context, builder, signature, arguments):
    a, b = (_as_vector(builder, kind, value) for kind, value in zip(signature.args, arguments))
    return builder.fcmp_ordered(">", a, b)


for _pair in _PAIRS:
    lower_builtin(operator.gt, *_pair)(_lower_greater)


@infer_global(min)
class _SmallerTyping(ConcreteTemplate):
    cases = [signature(F64x8, *pair) for pair in _PAIRS]


def _lower_smaller(context, builder, signature, arguments):
    a, b = (_as_vector(builder, kind, value) for kind, value in zip(signature.args, arguments))
    return builder.select(builder.fcmp_ordered("<", b, a), b, a)


for _pair in _PAIRS:
    lower_builtin(min, *_pair)(_lower_smaller)


@infer_global(math.exp)
class _ExpTyping(ConcreteTemplate):
    cases = [signature(F64x8, F64x8)]


@lower_builtin(math.exp, F64x8)
def _lower_exp(context, builder, signature, arguments):
    """Lane by lane through the scalar function: right, and as slow as eight of them."""
    function = cgutils.get_or_insert_function(builder.module, ir.FunctionType(_DOUBLE, [_DOUBLE]), "exp")
    result = ir.Constant(_VECTOR, ir.Undefined)
    for lane in range(LANES):
        index = ir.Constant(_I32, lane)
        result = builder.insert_element(result, builder.call(function, [builder.extract_element(arguments[0], index)]), index)
    return result


@intrinsic
def splat(typing, value):
    """Return a vector with a float in every lane."""
    return F64x8(types.float64), lambda context, builder, signature, arguments: _splat(builder, arguments[0])


def _call(builder, name, arguments):
    function = cgutils.get_or_insert_function(builder.module, ir.FunctionType(_VECTOR, [_VECTOR] * len(arguments)), f"llvm.{name}.v{LANES}f64")
    return builder.call(function, arguments)


@intrinsic
def sqrt8(typing, a):
    """Return the square roots of a vector."""
    return F64x8(F64x8), lambda context, builder, signature, arguments: _call(builder, "sqrt", arguments)


@intrinsic
def fma(typing, a, b, c):
    """Return a * b + c of three vectors or three floats, rounded once."""
    if a == F64x8:
        return F64x8(F64x8, F64x8, F64x8), lambda context, builder, signature, arguments: _call(builder, "fma", arguments)
    return types.float64(types.float64, types.float64, types.float64), lambda context, builder, signature, arguments: builder.fma(*arguments)


@intrinsic
def larger(typing, a, b):
    """Return a where a > b, else b: a NaN in `a` is not taken over."""

    def lower(context, builder, signature, arguments):
        return builder.select(builder.fcmp_ordered(">", arguments[0], arguments[1]), arguments[0], arguments[1])

    return F64x8(F64x8, F64x8), lower


@intrinsic
def select(typing, mask, a, b):
    """Return a where the mask is set, else b."""
    return F64x8(Mask8, F64x8, F64x8), lambda context, builder, signature, arguments: builder.select(*arguments)


@intrinsic
def lane_mask(typing, byte):
    """Return the eight bits of a uint8 as truth values, lowest bit first."""
    return Mask8(types.uint8), lambda context, builder, signature, arguments: builder.bitcast(arguments[0], _MASK)


@intrinsic
def any_of(typing, mask):
    """Return whether any lane of a mask is set."""

    def lower(context, builder, signature, arguments):
        bits = builder.bitcast(arguments[0], ir.IntType(LANES))
        return builder.icmp_unsigned("!=", bits, ir.Constant(ir.IntType(LANES), 0))

    return types.boolean(Mask8), lower


@intrinsic
def lane_sum(typing, a):
    """Return the sum of the lanes, always as ((0+4)+(2+6)) + ((1+5)+(3+7))."""

    def lower(context, builder, signature, arguments):
        vector, lanes = arguments[0], LANES
        while lanes > 1:
            half = lanes // 2
            low = builder.shuffle_vector(vector, vector, _lanes(range(half)))
            high = builder.shuffle_vector(vector, vector, _lanes(range(half, lanes)))
            vector, lanes = builder.fadd(low, high), half
        return builder.extract_element(vector, ir.Constant(_I32, 0))

    return types.float64(F64x8), lower


def _element(context, builder, kind, array, index):
    """Return a pointer to element `index` (flat) of an array."""
    return builder.gep(context.make_array(kind)(context, builder, array).data, [index])


@intrinsic
def load8(typing, array, index):
    """Return array[index] ... array[index + 7] of a contiguous float64 array."""

    def lower(context, builder, signature, arguments):
        pointer = _element(context, builder, signature.args[0], *arguments)
        return builder.load(builder.bitcast(pointer, _VECTOR.as_pointer()), align=8)

    return F64x8(array, types.intp), lower


@intrinsic
def store8(typing, array, index, vector):
    """Store a vector to array[index] ... array[index + 7]."""

    def lower(context, builder, signature, arguments):
        pointer = _element(context, builder, signature.args[0], arguments[0], arguments[1])
        builder.store(arguments[2], builder.bitcast(pointer, _VECTOR.as_pointer()), align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, F64x8), lower


def _gathered_rows(context, builder, signature, arguments, width):
    """Return the eight rows of `width` doubles that neighbour[k] ... neighbour[k + 7] name, as LLVM vectors."""
    table, neighbour, k = arguments
    kind, row = ir.VectorType(_DOUBLE, width), []
    for lane in range(LANES):
        index = builder.add(k, ir.Constant(k.type, lane))
        name = builder.zext(builder.load(_element(context, builder, signature.args[1], neighbour, index)), k.type)
        pointer = _element(context, builder, signature.args[0], table, builder.mul(name, ir.Constant(k.type, width)))
        row.append(builder.load(builder.bitcast(pointer, kind.as_pointer()), align=8))
    return row


@intrinsic
def gather_xy(typing, table, neighbour, k):
    """Return (x, y) of the rows neighbour[k] ... neighbour[k + 7] of a contiguous (n, 2) table; neighbour int32, not negative."""
    result = types.UniTuple(F64x8, 2)

    def lower(context, builder, signature, arguments):
        rows = _gathered_rows(context, builder, signature, arguments, 2)
        pairs = [builder.shuffle_vector(a, b, _lanes(range(4))) for a, b in zip(rows[0::2], rows[1::2])]
        fours = [builder.shuffle_vector(a, b, _lanes(range(8))) for a, b in zip(pairs[0::2], pairs[1::2])]
        columns = [builder.shuffle_vector(fours[0], fours[1], _lanes(range(axis, 16, 2))) for axis in (0, 1)]
        return context.make_tuple(builder, result, columns)

    return result(table, neighbour, types.intp), lower


@intrinsic
def gather_xyz(typing, table, neighbour, k):
    """Return (x, y, z) of the rows neighbour[k] ... neighbour[k + 7] of a contiguous (n, 4) table; neighbour int32, not negative."""
    result = types.UniTuple(F64x8, 3)

    def transposed(builder, a, b, c, d):
        """Columns 0 to 2 of four rows of four."""
        ab, ab1 = builder.shuffle_vector(a, b, _lanes([0, 4, 2, 6])), builder.shuffle_vector(a, b, _lanes([1, 5, 3, 7]))
        cd, cd1 = builder.shuffle_vector(c, d, _lanes([0, 4, 2, 6])), builder.shuffle_vector(c, d, _lanes([1, 5, 3, 7]))
        low, high = _lanes([0, 1, 4, 5]), _lanes([2, 3, 6, 7])
        return builder.shuffle_vector(ab, cd, low), builder.shuffle_vector(ab1, cd1, low), builder.shuffle_vector(ab, cd, high)

    def lower(context, builder, signature, arguments):
        rows = _gathered_rows(context, builder, signature, arguments, 4)
        halves = zip(transposed(builder, *rows[:4]), transposed(builder, *rows[4:]))
        return context.make_tuple(builder, result, [builder.shuffle_vector(a, b, _lanes(range(8))) for a, b in halves])

    return result(table, neighbour, types.intp), lower
