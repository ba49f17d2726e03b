# Sourced by the scripts of this folder: `launch N COMMAND...` runs a command on N ranks with whatever MPI is there.
export OMP_NUM_THREADS=1 # a rank is one thread: more would fight for the cores
if [ "$(id -u)" = 0 ]; then export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1; fi

cores() { # as Open MPI counts them: not hardware threads, nor what this process may not use (nproc would also listen to OMP_NUM_THREADS)
    local physical usable
    physical=$(lscpu -p=SOCKET,CORE 2>/dev/null | grep -v "^#" | sort -u | wc -l || true)
    usable=$(env -u OMP_NUM_THREADS -u OMP_THREAD_LIMIT nproc)
    echo $((physical > 0 && physical < usable ? physical : usable))
}

launch() {
    local ranks=$1 flags=()
    shift
    # Only Open MPI refuses more ranks than cores, and only it knows the flag; ranks that fit are bound to cores without it.
    if mpirun --version 2>/dev/null | grep -q "Open MPI" && [ "$ranks" -gt "$(cores)" ]; then flags=(--oversubscribe); fi
    mpirun -n "$ranks" ${flags[@]+"${flags[@]}"} "$@"
}
