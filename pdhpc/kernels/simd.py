"""An explicit SIMD value for numba: F64x8, eight doubles that go through a kernel together.

LLVM lowers the eight lanes to whatever the processor has (one AVX-512 register, two of AVX2, four of SSE2); every operation but `rsqrt8` is IEEE-exact and
done lane by lane in a fixed order, so results have the same bits on all of them that have fused multiply-add. `rsqrt8` is within 2 ulp on AVX-512 and exact
elsewhere, or everywhere with PDHPC_KERNELS=ieee. Values exist inside kernels only. In a kernel,

    from pdhpc.kernels.simd import fma, gather_xy, lane_mask, lane_sum, select, splat, sqrt8

    total = splat(0.0)
    for k in range(first, last, 8):                      # rows are padded to whole blocks of eight
        x, y = gather_xy(position, neighbour, k)         # rows neighbour[k] ... neighbour[k + 7] of position (n, 2)
        ex, ey = x - px, y - py                          # + - * / take vectors and floats, in any mix
        length = sqrt8(ex * ex + ey * ey)
        live = lane_mask(alive[k >> 3])                  # a byte as eight truth values
        total = fma(select(live, length, splat(0.0)), ex, total)
    result = lane_sum(total)

`min` and `math.exp` take vectors too, so that a material's law is written once and serves floats and vectors alike. U64x8 holds the bond states of eight
lattice particles, a word of 64 bonds each: words8 loads them, has_bit(words, b) gives bit b of each as truth values.
"""
import math
import operator
import os
import platform

from llvmlite import binding, ir
from numba.core import cgutils, types
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

from pdhpc.jit import inlined

LANES = 8
CHOICES = ("vector", "ieee", "reference")
"""What the environment variable PDHPC_KERNELS may hold: vectors, vectors with IEEE square roots and divisions only, or bond by bond."""

_DOUBLE, _I32, _I64 = ir.DoubleType(), ir.IntType(32), ir.IntType(64)
_VECTOR = ir.VectorType(_DOUBLE, LANES)
_MASK = ir.VectorType(ir.IntType(1), LANES)
_WORDS = ir.VectorType(ir.IntType(64), LANES)


class _F64x8Type(types.Type):
    def __init__(self):
        super().__init__(name="F64x8")


class _Mask8Type(types.Type):
    def __init__(self):
        super().__init__(name="Mask8")


class _U64x8Type(types.Type):
    def __init__(self):
        super().__init__(name="U64x8")


F64x8, Mask8, U64x8 = _F64x8Type(), _Mask8Type(), _U64x8Type()


@register_model(_F64x8Type)
class _F64x8Model(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _VECTOR)


@register_model(_Mask8Type)
class _Mask8Model(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _MASK)


@register_model(_U64x8Type)
class _U64x8Model(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _WORDS)


def chosen():
    """Return which kernels to use, one of CHOICES: as PDHPC_KERNELS says, else vectors wherever eight fused multiply-adds are fast (on x86: AVX2 and FMA).

    Local. Ask once, at import, and choose between two functions by the answer: numba's cache would not notice a change of it inside of one function.

    Raises
    ------
    ValueError: PDHPC_KERNELS holds another word.
    """
    choice = os.environ.get("PDHPC_KERNELS")
    if choice is None:
        features = binding.get_host_cpu_features()
        fast = platform.machine() not in ("x86_64", "AMD64") or bool(features.get("avx2") and features.get("fma"))
        return "vector" if fast else "reference"
    if choice not in CHOICES:
        raise ValueError(f"PDHPC_KERNELS={choice}: must be one of {', '.join(CHOICES)}")
    return choice


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
def _rsqrt_seed(typing, a):
    """Return 1/sqrt of a vector to 14 bits (AVX-512 only: elsewhere LLVM could not make code of it)."""

    def lower(context, builder, signature, arguments):
        kind = ir.FunctionType(_VECTOR, [_VECTOR, _VECTOR, ir.IntType(8)])
        function = cgutils.get_or_insert_function(builder.module, kind, "llvm.x86.avx512.rsqrt14.pd.512")
        return builder.call(function, [arguments[0], ir.Constant(_VECTOR, [0.0] * LANES), ir.Constant(ir.IntType(8), -1)])

    return F64x8(F64x8), lower


@inlined
def rsqrt8_exact(x):
    """Return 1/sqrt(x) of a vector by an IEEE square root and division."""
    return 1.0 / sqrt8(x)


@inlined
def _rsqrt8_fast(x):
    """Return 1/sqrt(x) of a vector: a seed of 14 bits and one step of fourth order in h = 1 - x y^2, y (1 + h/2 + 3 h^2/8 + 5 h^3/16)."""
    y = _rsqrt_seed(x)
    h = fnma(x * y, y, splat(1.0))
    return fma(y * h, fma(fma(splat(0.3125), h, splat(0.375)), h, splat(0.5)), y)


rsqrt8 = _rsqrt8_fast if chosen() == "vector" and binding.get_host_cpu_features().get("avx512f") else rsqrt8_exact
"""1/sqrt of a vector, positive and finite lanes within 2 ulp: the fast one on AVX-512, unless PDHPC_KERNELS=ieee."""


@inlined
def _root8_fast(x):
    """Return sqrt(x) of a vector as x / sqrt(x)."""
    return x * _rsqrt8_fast(x)


root8 = _root8_fast if rsqrt8 is _rsqrt8_fast else sqrt8
"""sqrt of a vector, as exact as rsqrt8."""


@intrinsic
def fma(typing, a, b, c):
    """Return a * b + c of three vectors or three floats, rounded once."""
    if a == F64x8:
        return F64x8(F64x8, F64x8, F64x8), lambda context, builder, signature, arguments: _call(builder, "fma", arguments)
    return types.float64(types.float64, types.float64, types.float64), lambda context, builder, signature, arguments: builder.fma(*arguments)


@intrinsic
def fnma(typing, a, b, c):
    """Return c - a * b of three vectors, rounded once."""

    def lower(context, builder, signature, arguments):
        return _call(builder, "fma", [builder.fneg(arguments[0]), arguments[1], arguments[2]])

    return F64x8(F64x8, F64x8, F64x8), lower


@intrinsic
def either(typing, a, b):
    """Return where mask a or mask b is set."""
    return Mask8(Mask8, Mask8), lambda context, builder, signature, arguments: builder.or_(*arguments)


@intrinsic
def both(typing, a, b):
    """Return where masks a and b are set."""
    return Mask8(Mask8, Mask8), lambda context, builder, signature, arguments: builder.and_(*arguments)


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


@intrinsic
def lane_max(typing, a):
    """Return the largest lane; lanes that are NaN may be left out."""

    def lower(context, builder, signature, arguments):
        result = builder.extract_element(arguments[0], ir.Constant(_I32, 0))
        for lane in range(1, LANES):
            value = builder.extract_element(arguments[0], ir.Constant(_I32, lane))
            result = builder.select(builder.fcmp_ordered(">", value, result), value, result)
        return result

    return types.float64(F64x8), lower


@intrinsic
def as_vector(typing, a):
    """Return a vector as it is, and a float in every lane of one."""
    kind = F64x8 if a == F64x8 else types.float64
    return F64x8(kind), lambda context, builder, signature, arguments: _as_vector(builder, kind, arguments[0])


def _element(context, builder, kind, array, index):
    """Return a pointer to element `index` (flat) of an array."""
    return builder.gep(context.make_array(kind)(context, builder, array).data, [index])


@intrinsic
def at(typing, array, index):
    """Return element `index` (flat, not negative) of a contiguous array, without numba's care for negative indices."""

    def lower(context, builder, signature, arguments):
        return context.unpack_value(builder, signature.args[0].dtype, _element(context, builder, signature.args[0], *arguments))

    return array.dtype(array, types.intp), lower


@intrinsic
def load8(typing, array, index):
    """Return array[index] ... array[index + 7] of a contiguous float64 array."""

    def lower(context, builder, signature, arguments):
        pointer = _element(context, builder, signature.args[0], *arguments)
        return builder.load(builder.bitcast(pointer, _VECTOR.as_pointer()), align=8)

    return F64x8(array, types.intp), lower


@intrinsic
def words8(typing, array, index):
    """Return array[index] ... array[index + 7] of a contiguous uint64 array as U64x8."""

    def lower(context, builder, signature, arguments):
        pointer = _element(context, builder, signature.args[0], *arguments)
        return builder.load(builder.bitcast(pointer, _WORDS.as_pointer()), align=8)

    return U64x8(array, types.intp), lower


@intrinsic
def has_bit(typing, words, bit):
    """Return bit `bit` (int64, 0 to 63) of each of eight words as truth values."""

    def lower(context, builder, signature, arguments):
        one = builder.shl(ir.Constant(_I64, 1), arguments[1])
        splatted = builder.insert_element(ir.Constant(_WORDS, ir.Undefined), one, ir.Constant(_I32, 0))
        splatted = builder.shuffle_vector(splatted, ir.Constant(_WORDS, ir.Undefined), _lanes([0] * LANES))
        return builder.icmp_unsigned("!=", builder.and_(arguments[0], splatted), ir.Constant(_WORDS, [0] * LANES))

    return Mask8(U64x8, types.int64), lower


@intrinsic
def lookup8(typing, table, rows, row, columns, column):
    """Return table[rows[row + k], columns[column + k]], k = 0 ... 7, of a contiguous square float64 table; rows and columns uint8 arrays.

    An index beyond the table, that of a slot without a particle, reads its first entry.
    """

    def lower(context, builder, signature, arguments):
        table, rows, row, columns, column = arguments
        kind = signature.args[0]
        width = builder.extract_value(context.make_array(kind)(context, builder, table).shape, 1)
        result = ir.Constant(_VECTOR, ir.Undefined)

        def index(kind, array, first, lane):
            entry = builder.load(_element(context, builder, kind, array, builder.add(first, ir.Constant(first.type, lane))))
            entry = builder.zext(entry, first.type)
            return builder.select(builder.icmp_unsigned("<", entry, width), entry, ir.Constant(first.type, 0))

        for lane in range(LANES):
            a, b = index(signature.args[1], rows, row, lane), index(signature.args[3], columns, column, lane)
            value = builder.load(_element(context, builder, kind, table, builder.add(builder.mul(a, width), b)))
            result = builder.insert_element(result, value, ir.Constant(_I32, lane))
        return result

    return F64x8(table, rows, types.intp, columns, types.intp), lower


@intrinsic
def pick8(typing, table, rows, row):
    """Return table[rows[row + k]], k = 0 ... 7, of a contiguous float64 table; rows a uint8 array; an index beyond the table reads its first entry."""

    def lower(context, builder, signature, arguments):
        table, rows, row = arguments
        length = builder.extract_value(context.make_array(signature.args[0])(context, builder, table).shape, 0)
        result = ir.Constant(_VECTOR, ir.Undefined)
        for lane in range(LANES):
            entry = builder.load(_element(context, builder, signature.args[1], rows, builder.add(row, ir.Constant(row.type, lane))))
            entry = builder.zext(entry, row.type)
            entry = builder.select(builder.icmp_unsigned("<", entry, length), entry, ir.Constant(row.type, 0))
            value = builder.load(_element(context, builder, signature.args[0], table, entry))
            result = builder.insert_element(result, value, ir.Constant(_I32, lane))
        return result

    return F64x8(table, rows, types.intp), lower


@intrinsic
def store8(typing, array, index, vector):
    """Store a vector to array[index] ... array[index + 7]."""

    def lower(context, builder, signature, arguments):
        pointer = _element(context, builder, signature.args[0], arguments[0], arguments[1])
        builder.store(arguments[2], builder.bitcast(pointer, _VECTOR.as_pointer()), align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, F64x8), lower


@intrinsic
def gather8(typing, column, neighbour, k):
    """Return column[neighbour[k]] ... column[neighbour[k + 7]] of a contiguous float64 array; neighbour int32, not negative."""

    def lower(context, builder, signature, arguments):
        column, neighbour, k = arguments
        result = ir.Constant(_VECTOR, ir.Undefined)
        for lane in range(LANES):
            index = builder.add(k, ir.Constant(k.type, lane))
            name = builder.zext(builder.load(_element(context, builder, signature.args[1], neighbour, index)), k.type)
            value = builder.load(_element(context, builder, signature.args[0], column, name))
            result = builder.insert_element(result, value, ir.Constant(_I32, lane))
        return result

    return F64x8(column, neighbour, types.intp), lower


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
