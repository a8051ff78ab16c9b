#!/usr/bin/env bash
# compile_with.sh COMMAND… -- COMPILER ARGUMENTS…: runs COMMAND in COMPILER's place. CMake knows one compiler of C++ in a
# build; as the launcher of some targets (compiler.cmake) this gives them another.
set -euo pipefail

command=()
while [ "$1" != -- ]; do
  command+=("$1")
  shift
done
shift 2

# Told to precompile a header as g++ is told, clang would first read the precompiled header that is there, were it stale or
# g++'s. The result holds paths and times of this tree: ccache may not give it to another one.
if [[ " $* " == *" -x c++-header "* ]]; then
  export CCACHE_DISABLE=1
  for ((i = 1; i < $#; ++i)); do
    if [ "${!i}" = -o ]; then
      output=$((i + 1))
      rm -f "${!output}"
    fi
  done
fi
exec "${command[@]}" "$@"
