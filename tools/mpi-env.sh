# Sourced by tools/demo and tools/test: `launch N COMMAND...` runs a command on N ranks with whatever MPI is there.
export OMP_NUM_THREADS=1
if [ "$(id -u)" = 0 ]; then export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1; fi

launch() {
    local ranks=$1 flags=()
    shift
    if mpirun --version 2>/dev/null | grep -q "Open MPI" && [ "$ranks" -gt "$(nproc)" ]; then flags=(--oversubscribe); fi
    mpirun -n "$ranks" "${flags[@]}" "$@"
}
