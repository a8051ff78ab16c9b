#!/usr/bin/env bash
# The kernels on AArch64, where they are compiled for NEON: the tests of kernels and of scalar operations, cross-compiled
# and run by qemu. Usage: aarch64.sh BUILD-DIRECTORY [TEST…], without tests those below; a test is room/name. Needs
# g++-aarch64-linux-gnu, qemu-user and the sources of GoogleTest. CMAKE_BUILD_PARALLEL_LEVEL is how many run at once.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
googletest=/usr/src/googletest/googletest
compiler=aarch64-linux-gnu-g++
eigen=$(pkg-config --cflags eigen3)
build=$1
shift
[ $# -gt 0 ] || set -- lie/arrays_test lie/accuracy_test stats/mean_kernel_test
for need in "$compiler" qemu-aarch64; do
  command -v "$need" >/dev/null || { echo "aarch64: no $need" && exit 1; }
done
mkdir -p "$build"
export root googletest compiler eigen build

"$compiler" -std=c++20 -O1 -I$googletest -I$googletest/include -c $googletest/src/gtest-all.cc -o "$build/gtest.o"
"$compiler" -std=c++20 -O1 -I$googletest/include -c $googletest/src/gtest_main.cc -o "$build/main.o"

one() {
  local program=$build/${1//\//_}
  # shellcheck disable=SC2086
  if "$compiler" -std=c++20 -O1 -Wall -Wextra -Wshadow -Werror -I"$root" -I"$root/tests" ${eigen//-I/-isystem } \
    -isystem "$googletest/include" "$root/tests/$1.cpp" "$build/gtest.o" "$build/main.o" -o "$program" >"$program.log" 2>&1 &&
    qemu-aarch64 -L /usr/aarch64-linux-gnu "$program" --gtest_brief=1 >"$program.log" 2>&1; then
    echo "aarch64: $1: $(tail -n 1 "$program.log")"
  else
    tail -n 40 "$program.log"
    echo "aarch64: $1: failed"
    return 1
  fi
}
export -f one
# shellcheck disable=SC2016 # expanded by the inner shell
printf '%s\n' "$@" | xargs -P "${CMAKE_BUILD_PARALLEL_LEVEL:-$(nproc)}" -I{} bash -c 'one "$1"' aarch64 {}
