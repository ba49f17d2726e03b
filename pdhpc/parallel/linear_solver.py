"""The only KSP: linear systems whose operator is a function or a matrix, solved by PETSc on the ranks that hold them."""
import contextlib
import re
from typing import NamedTuple

import numpy as np


_prefixes = set()  # of the solvers made in this process


def use_options(words):
    """Hand the command line's PETSc options, such as ["-interface_ksp_rtol", "1e-10"], to PETSc, before any solver is made. Collective."""
    if words:
        import petsc4py

        petsc4py.init(["pdhpc", *words])


def start_petsc():
    """Let PETSc start on all ranks at once: it must not be left to the first that needs it, who would wait for the others. Collective over all ranks.

    PETSc's way to meet a reader that has gone (a page of text to the terminal) is left to Python's.
    """
    import signal

    from petsc4py import PETSc

    PETSc.Sys.isInitialized()
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)


def unused_options(words):
    """Return warnings about options that nothing used: those without the prefix of a solver of this run, and those that PETSc was never asked for. Local."""
    options = [word for word in words if word.startswith("-") and word[1:2].isalpha()]
    strange = [word for word in options if not any(word[1:].startswith(prefix) for prefix in _prefixes)]
    unknown = [word for word in options if word not in strange and not _was_used(word[1:])]
    there = f"the prefixes of this run's solvers are {', '.join(sorted(_prefixes))}" if _prefixes else "no PETSc solver takes part in this scene"
    found = [f"unused are the options {' '.join(strange)}: {there}"] if strange else []
    return found + ([f"unused are the options {' '.join(unknown)}: no solver asked for them, they may be misspelt"] if unknown else [])


def _was_used(name):
    """Return whether PETSc was asked for an option so far, by its own count, which petsc4py does not pass on. Local."""
    import ctypes

    from petsc4py import PETSc

    used = ctypes.c_int(0)
    ctypes.CDLL(PETSc.__file__).PetscOptionsUsed(None, name.encode(), ctypes.byref(used))
    return bool(used.value)


class Defaults(NamedTuple):
    """How a system is solved unless PETSc's options say otherwise: "cg" to a relative tolerance, or "richardson" for a fixed number of iterations.

    preconditioner : of matrices, PETSc's name of it.
    """

    kind: str
    tolerance: float = 1e-8
    iterations: int = 200
    preconditioner: str = "jacobi"


class SolverError(RuntimeError):
    """A system that was not solved: one sentence with the reason and the residual."""


class OptionError(ValueError):
    """PETSc options that a solver cannot take: one sentence with the options and PETSc's own word on them."""


def _take_options(ksp, prefix, n):
    """Let PETSc's options of a prefix act on a KSP of n unknowns in all, and set it up, which shows whether they fit its system. Collective over its ranks.

    Raises
    ------
    OptionError: there are options of the prefix, and PETSc cannot take them.
    """
    from petsc4py import PETSc

    try:
        ksp.setFromOptions()
        if n > 0:
            ksp.setUp()
    except PETSc.Error as error:
        options = {f"-{name}": value for name, value in PETSc.Options().getAll().items() if name.startswith(prefix)}
        if not options:
            raise
        word = re.sub(r"^\[\d+\] ", "", str(error).splitlines()[-1]).strip(" .")
        named = {name: value for name, value in options.items() if value and re.search(rf"(?<!\w){re.escape(value)}(?!\w)", word, re.IGNORECASE)}
        listed = ", ".join(f"{name} {value or ''}".strip() for name, value in (named or options).items())
        raise OptionError(f"PETSc does not take {listed}: {word}") from None


class LinearSolver:
    """KSP on an operator given as a function, preconditioned by a diagonal or by blocks; PETSc's options of the given prefix take precedence over the defaults.

    iterations : of the last solve. failure : None, or what the first solve that did not converge has to say.
    """

    def __init__(self, comm, prefix, defaults, n_local, apply, diagonal):
        """Set the KSP up. Collective over `comm`.

        prefix : of PETSc options, such as "interface_". defaults : Defaults. apply : function (n_local,) -> (n_local,) or of that size.
        diagonal : n_local entries above 0, the preconditioner; or (n, d, d) inverses of its blocks, n d = n_local.

        Raises
        ------
        OptionError: PETSc cannot take an option of the prefix; on all ranks that have unknowns.
        """
        from petsc4py import PETSc

        diagonal = np.asarray(diagonal, float)
        self._preconditioner = _Blocks(diagonal) if diagonal.ndim == 3 else _Diagonal(diagonal.ravel().copy())
        self.prefix, self.iterations, self.failure = prefix, 0, None
        _prefixes.add(prefix)
        self._n = comm.allreduce(n_local)
        sizes = ((n_local, self._n), (n_local, self._n))
        operator = PETSc.Mat().createPython(sizes, _Shell(apply), comm=comm)
        operator.setUp()
        self._ksp = PETSc.KSP().create(comm)
        self._ksp.setOptionsPrefix(prefix)
        self._ksp.setOperators(operator)
        self._ksp.getPC().setType("python")
        self._ksp.getPC().setPythonContext(self._preconditioner)
        self._ksp.setType(defaults.kind)
        self._ksp.setTolerances(rtol=defaults.tolerance, atol=1e-300, max_it=defaults.iterations)
        if defaults.kind == "richardson":
            self._ksp.setNormType(PETSc.KSP.NormType.NONE)
        _take_options(self._ksp, prefix, self._n)
        self._right, self._x = operator.createVecs()

    def solve(self, right):
        """Return the solution (n_local,). Collective.

        When the KSP's reason says that it diverged, `failure` holds a sentence from then on: ranks that have no part in the system must learn of it too, so
        who drives the run agrees on it.
        """
        if self._n == 0:
            return np.zeros(0)
        self._right.getArray()[...] = right
        self._x.set(0.0)
        self._ksp.solve(self._right, self._x)
        self.iterations = self._ksp.getIterationNumber()
        self.failure = self.failure or _diverged(self._ksp, self.prefix)
        return self._x.getArray().copy()

    def aim(self, tolerance):
        """Set the relative tolerance of the next solves, unless an option gives it. Local."""
        from petsc4py import PETSc

        if not PETSc.Options().hasName(f"{self.prefix}ksp_rtol"):
            self._ksp.setTolerances(rtol=tolerance)

    def precondition(self, blocks):
        """Take other inverse blocks, (n, d, d). Local."""
        self._preconditioner.blocks = blocks

    def condition(self):
        """Return an estimate, from below, of the condition number of the preconditioned operator, from CG's iterations for one right side. Collective."""
        if self._n == 0:
            return 1.0
        first, last = self._x.getOwnershipRange()
        self._right.getArray()[...] = np.cos(2.4 * np.arange(first, last) ** 1.5)  # of no structure
        self._x.set(0.0)
        ksp = type(self._ksp)().create(self._ksp.getComm())  # CG makes room for its coefficients when it is set up
        ksp.setOperators(*self._ksp.getOperators())
        ksp.setPC(self._ksp.getPC())
        ksp.setType("cg")
        ksp.setComputeSingularValues(True)
        ksp.setTolerances(rtol=1e-6, atol=1e-300, max_it=200)
        ksp.solve(self._right, self._x)
        most, least = ksp.computeExtremeSingularValues()
        return most / least if least > 0.0 else np.inf


class AssembledSolver:
    """KSP on a matrix given by rows, preconditioned by its diagonal; PETSc's options of the given prefix take precedence over the defaults.

    The relative tolerance is that of the preconditioner's norm (r^T D^-1 r)^(1/2). Ranks may have no rows.

    iterations : of the last solve. failure : None, or what the first solve that did not converge has to say.
    """

    def __init__(self, comm, prefix, defaults, indptr, columns):
        """Fix the rows' columns. Collective over `comm`.

        prefix : of PETSc options, such as "gfem_". defaults : Defaults. indptr (n_local + 1,), columns (nnz,) : of this rank's rows, columns in global numbers,
        where each rank's rows are numbered in one run, see first_row.

        Raises
        ------
        OptionError: PETSc cannot take an option of the prefix; on all ranks.
        """
        from petsc4py import PETSc

        self.prefix, self.iterations, self.failure = prefix, 0, None
        _prefixes.add(prefix)
        n_local = len(indptr) - 1
        self._n = comm.allreduce(n_local)
        self._indptr, self._columns = np.asarray(indptr, PETSc.IntType), np.asarray(columns, PETSc.IntType)
        sizes = ((n_local, self._n), (n_local, self._n))
        self._matrix = PETSc.Mat().createAIJ(sizes, csr=(self._indptr, self._columns, np.zeros(len(columns))), comm=comm)
        self._ksp = PETSc.KSP().create(comm)
        self._ksp.setOptionsPrefix(prefix)
        self._ksp.setOperators(self._matrix)
        self._ksp.getPC().setType("jacobi")
        self._ksp.setType(defaults.kind)
        self._ksp.setNormType(PETSc.KSP.NormType.NATURAL)
        self._ksp.setTolerances(rtol=defaults.tolerance, atol=1e-300, max_it=defaults.iterations)
        self._ksp.setComputeSingularValues(True)
        self._ksp.setInitialGuessNonzero(True)
        self.fill(np.zeros(len(columns)))
        _take_options(self._ksp, prefix, self._n)
        self._right, self._x = self._matrix.createVecs()
        self._product = self._right.duplicate()

    def fill(self, values):
        """Set the entries of this rank's rows, (nnz,). Rows of zeros, of unknowns that take no part, get a one on the diagonal, which preconditioners ask for. Collective."""
        self._matrix.setValuesCSR(self._indptr, self._columns, values)
        self._matrix.assemble()
        diagonal = self._matrix.getDiagonal()
        entries = diagonal.getArray()
        self._absent = entries == 0.0
        entries[self._absent] = 1.0
        self._matrix.setDiagonal(diagonal)

    def solve(self, right, guess=None):
        """Return the solution (n_local,); `failure` as of LinearSolver.solve. Collective.

        guess : None, or (n_local,): the iteration starts from that multiple of it which is nearest to the solution in the norm of the matrix, positive definite.
        """
        if self._n == 0:
            return np.zeros(0)
        self._right.getArray()[...] = right
        self._x.set(0.0)
        if guess is not None:
            self._x.getArray()[...] = guess
            self._matrix.mult(self._x, self._product)
            size = self._x.dot(self._product)
            self._x.scale(self._x.dot(self._right) / size if size > 0.0 else 0.0)
        self._ksp.solve(self._right, self._x)
        self.iterations = self._ksp.getIterationNumber()
        self.failure = self.failure or _diverged(self._ksp, self.prefix)
        return self._x.getArray().copy()

    def condition(self):
        """Return an estimate, from below, of the condition number of the preconditioned matrix, from the iterations for one right side. Collective."""
        if self._n == 0:
            return 1.0
        first, last = self._matrix.getOwnershipRange()
        self._right.getArray()[...] = np.cos(2.4 * np.arange(first, last) ** 1.5) * np.sqrt(self._matrix.getDiagonal().getArray())  # of no structure
        self._right.getArray()[self._absent] = 0.0
        self._x.set(0.0)
        self._ksp.solve(self._right, self._x)
        most, least = self._ksp.computeExtremeSingularValues()
        return most / least if least > 0.0 else np.inf


def first_row(comm, n_local):
    """Return the global number of this rank's first row, when the ranks' rows are numbered one after the other. Collective."""
    return comm.scan(n_local) - n_local


_REASONS = {  # PETSc's KSPConvergedReason: what it means, and what to do about it
    -3: ("the iterations are used up", "raise -{prefix}ksp_max_it"),
    -4: ("the residual grew beyond all bounds", "try another -{prefix}pc_type, such as jacobi"),
    -5: ("the method broke down", "try another -{prefix}ksp_type, such as minres"),
    -8: ("the preconditioner is not positive definite", "try another -{prefix}pc_type, such as jacobi"),
    -9: ("a number is not finite", "look for moduli, loads or motions that are out of all proportion"),
    -10: ("the matrix is not positive definite", "look for parts that nothing holds, and for moduli at the limit of what is stable"),
    -11: ("the preconditioner could not be set up", "try another -{prefix}pc_type, such as jacobi"),
}


def _failure(ksp, prefix):
    """Return what to say of a KSP that did not converge: why, in PETSc's number and in words, and what to do."""
    reason = int(ksp.reason)
    meaning, advice = _REASONS.get(reason, ("see KSPConvergedReason in PETSc's manual", "try another -{prefix}ksp_type"))
    return (f"the KSP {prefix} did not converge in {ksp.getIterationNumber()} iterations, residual norm {ksp.getResidualNorm():.3g}: {meaning}"
            f" (reason {reason}); {advice.format(prefix=prefix)}")


def _diverged(ksp, prefix):
    """Return None, or what to say of the last solve of a time step, if it did not converge."""
    return None if int(ksp.reason) > 0 else _failure(ksp, prefix) + " or take a smaller step"


class Rows(NamedTuple):
    """The rows of a sparse matrix that this rank has: start (n_local + 1,), columns, global, and values of their entries, by row in PETSc's numbering."""

    start: np.ndarray
    columns: np.ndarray
    values: np.ndarray


class MatrixSolver:
    """KSP on an assembled matrix (AIJ); PETSc's options of the given prefix take precedence over the defaults.

    iterations : of the last solve. residual : its norm, that of b - A x unless options say otherwise.
    """

    def __init__(self, comm, prefix, defaults, rows, block=1, near_null=None):
        """Set the KSP up. Collective over `comm`.

        prefix : of PETSc options. defaults : Defaults. rows : Rows. block : unknowns per vertex, which follow each other.
        near_null : (n_local, k) vectors that the matrix nearly takes to 0, such as rigid motions; multigrid ("gamg") needs them for elasticity.

        Raises
        ------
        OptionError: PETSc cannot take an option of the prefix; on all ranks.
        """
        from petsc4py import PETSc

        self.prefix, self.iterations, self.residual = prefix, 0, 0.0
        _prefixes.add(prefix)
        n_local = len(rows.start) - 1
        sizes = (n_local, comm.allreduce(n_local))
        entries = (rows.start.astype(PETSc.IntType), rows.columns.astype(PETSc.IntType), rows.values)
        self._matrix = PETSc.Mat().createAIJ((sizes, sizes), bsize=block, csr=entries, comm=comm)
        self._matrix.setOption(PETSc.Mat.Option.SPD, True)
        if near_null is not None:
            self._matrix.setNearNullSpace(_near_null_space(self._matrix, near_null, comm))
        self._ksp = PETSc.KSP().create(comm)
        self._ksp.setOptionsPrefix(prefix)
        self._ksp.setOperators(self._matrix)
        self._ksp.setType(defaults.kind)
        self._ksp.getPC().setType(defaults.preconditioner)
        self._ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
        self._ksp.setTolerances(rtol=defaults.tolerance, atol=1e-300, max_it=defaults.iterations)
        with _adding_in_one_order(comm):
            _take_options(self._ksp, prefix, sizes[1])
        self._right, self._x = self._matrix.createVecs()

    def solve(self, right, guess=None):
        """Return the solution (n_local,), starting at `guess` or 0. Collective.

        Raises
        ------
        SolverError: the KSP's reason says that it diverged; on all ranks.
        """
        self._right.getArray()[...] = right
        self._ksp.setInitialGuessNonzero(guess is not None)
        self._x.getArray()[...] = 0.0 if guess is None else guess
        self._ksp.solve(self._right, self._x)
        self.iterations, self.residual = self._ksp.getIterationNumber(), self._ksp.getResidualNorm()
        if not int(self._ksp.reason) > 0:
            raise SolverError(_failure(self._ksp, self.prefix))
        return self._x.getArray().copy()


@contextlib.contextmanager
def _adding_in_one_order(comm):
    """Let multigrid form its coarse matrices, meanwhile, the way that adds what ranks sent in their order.

    PETSc's other ways add it as it arrives, so that each run has other sums where there are more than two. It knows this one on several ranks alone.
    """
    from petsc4py import PETSc

    options, name = PETSc.Options(), "matptap_via"
    if comm.size < 3 or options.hasName(name):
        yield
        return
    options.setValue(name, "allatonce")
    try:
        yield
    finally:
        options.delValue(name)


def _near_null_space(matrix, vectors, comm):
    """Return the NullSpace of vectors (n_local, k), made orthonormal over all ranks. Collective."""
    from petsc4py import PETSc

    found = []
    for column in vectors.T:
        vector = matrix.createVecRight()
        vector.getArray()[...] = column
        for other in 2 * found:  # twice: one pass leaves what rounding left
            vector.axpy(-vector.dot(other), other)
        if vector.norm() > 0.0:
            vector.normalize()
            found.append(vector)
    return PETSc.NullSpace().create(constant=False, vectors=found, comm=comm)


class _Shell:
    """PETSc's context of an operator that is a function."""

    def __init__(self, apply):
        self._apply = apply

    def mult(self, matrix, x, y):
        """y = A x."""
        y.getArray()[...] = np.ravel(self._apply(x.getArray(readonly=True)))


class _Diagonal:
    """PETSc's context of a diagonal preconditioner."""

    def __init__(self, diagonal):
        self._diagonal = diagonal

    def apply(self, preconditioner, x, y):
        """y = D^-1 x."""
        np.divide(x.getArray(readonly=True), self._diagonal, out=y.getArray())


class _Blocks:
    """PETSc's context of a preconditioner of blocks whose inverses are given, (n, d, d)."""

    def __init__(self, blocks):
        self.blocks = blocks

    def apply(self, preconditioner, x, y):
        """y = B^-1 x."""
        parts = x.getArray(readonly=True).reshape(self.blocks.shape[:2])
        np.einsum("nab,nb->na", self.blocks, parts, out=y.getArray().reshape(parts.shape))
