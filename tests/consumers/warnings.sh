#!/usr/bin/env bash
# No warning from the headers in a user's own unit, which compiles the estimators as well (LIESTAT_HEADER_ONLY), with the compiler that CXX names, else with g++ and clang++ where they
# are installed; Boost's and Random123's own headers are the system's. Usage: warnings.sh [UNIT…], without arguments all of
# them; CMAKE_BUILD_PARALLEL_LEVEL is how many compilers run at once.
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../.." && pwd)
eigen=$(pkg-config --cflags eigen3 2>/dev/null || echo "-I${EIGEN_INCLUDE_DIR:-/usr/include/eigen3}")
export root eigen

# check COMPILER UNIT
check() {
  local needed='' name output
  name="$1: $(basename "$2")"
  case $2 in
    *_validation.cpp) needed='#include <boost/math/special_functions/beta.hpp>\n#include <Random123/philox.h>\n' ;;
    *_visual_inertial.cpp) needed='#include <Random123/philox.h>\n' ;;
  esac
  # shellcheck disable=SC2059
  if ! printf "$needed" | $1 -std=c++20 -E -x c++ - >/dev/null 2>&1; then
    echo "warnings: $name: SKIPPED, Boost.Math or Random123 is not installed"
    return 0
  fi
  # shellcheck disable=SC2086
  output=$($1 -std=c++20 -DLIESTAT_HEADER_ONLY -fsyntax-only -Wall -Wextra -Wconversion -Wsign-conversion -Wshadow -Werror -I"$root" \
    ${eigen//-I/-isystem } "$2" 2>&1) || {
    echo "$output"
    echo "warnings: $name: failed"
    return 1
  }
  echo "warnings: $name: none"
}
export -f check

[ $# -gt 0 ] || set -- "$here"/warnings_*.cpp
for compiler in ${CXX:-g++ clang++}; do
  if command -v "$compiler" >/dev/null; then
    printf '%s\n' "$@" | xargs -P "${CMAKE_BUILD_PARALLEL_LEVEL:-$(nproc)}" -I{} bash -c 'check "$1" {}' warnings "$compiler"
  else
    echo "warnings: $compiler: SKIPPED, it is not installed"
  fi
done
