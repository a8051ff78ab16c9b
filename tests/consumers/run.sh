#!/usr/bin/env bash
# Builds and runs one tiny program in each way that a user can take liestat: in place, by add_subdirectory, by
# find_package and by pkg-config from an installed tree; the estimators of fusion/ linked and header-only. Usage: run.sh [WORK_DIRECTORY]; CXX and CMAKE are obeyed.
# Without pkg-config its part is left out, and said to be: nothing else of liestat needs it. Before that, what a user's
# own unit gets to see of a mistake: one sentence. (warnings.sh: no warning.)
set -euo pipefail

here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../.." && pwd)
CXX=${CXX:-c++}
CMAKE=${CMAKE:-cmake}
export CXX
# CMake would ask for make, which a machine that builds with Ninja need not have.
if [ -z "${CMAKE_GENERATOR:-}" ] && command -v ninja >/dev/null; then export CMAKE_GENERATOR=Ninja; fi
if [ $# -gt 0 ]; then
  mkdir -p "$1"
  work=$(cd "$1" && pwd)
else
  work=$(mktemp -d)
  trap 'rm -rf "$work"' EXIT
fi
rm -rf "$work/build" "$work/prefix" "$work/moved"
mkdir -p "$work/build"

# Output is of interest only when something fails.
quietly() {
  "$@" >"$work/log" 2>&1 || {
    cat "$work/log"
    echo "consumers: failed: $*" >&2
    exit 1
  }
}

built_and_ran() {
  local program=$1 what=$2
  shift 2
  "$program" "$@" >"$work/log" || {
    cat "$work/log"
    echo "consumers: $what: the program failed" >&2
    exit 1
  }
  echo "consumers: $what: built and ran"
}

cd "$work/build"
eigen=$(pkg-config --cflags eigen3 2>/dev/null || echo "-I${EIGEN_INCLUDE_DIR:-/usr/include/eigen3}")

# shellcheck disable=SC2086 # several flags in one variable
quietly $CXX -std=c++20 -I"$root" $eigen "$here/main.cpp" -o in_place
built_and_ran ./in_place "in place"

# A mistake is answered by one error, and that is a sentence of ours. Program 0 has none and compiles. Not with clang:
# clang 14 cannot use the views of g++'s standard library.
if $CXX --version | grep -q clang; then
  echo "consumers: mistakes: SKIPPED, g++ answers them"
else
  # The headers are read once for all of them.
  grep '^#include' "$here/sentences.cpp" >"$work/sentences.hpp"
  # shellcheck disable=SC2086
  quietly $CXX -std=c++20 -DLIESTAT_HEADER_ONLY -x c++-header -I"$root" $eigen "$work/sentences.hpp" -o "$work/sentences.hpp.gch"
  for mistake in $(seq 0 22); do
    # shellcheck disable=SC2086
    errors=$($CXX -std=c++20 -fsyntax-only -DLIESTAT_HEADER_ONLY -DMISTAKE=$mistake -I"$root" $eigen -include "$work/sentences.hpp" \
      "$here/sentences.cpp" 2>&1 | grep -E '(^|[ :])error:' || true)
    expected=1
    [ "$mistake" != 0 ] || expected=0
    [ "$(printf '%s' "$errors" | grep -c .)" = $expected ] &&
      [ "$(printf '%s' "$errors" | grep -c 'liestat: \|Frechet mean needs\|groupMean needs')" = $expected ] || {
      echo "$errors"
      echo "consumers: failed: mistake $mistake of sentences.cpp is not answered by one sentence" >&2
      exit 1
    }
  done
  # shellcheck disable=SC2086
  fast() { $CXX -std=c++20 -fsyntax-only -DLIESTAT_HEADER_ONLY -DMISTAKE=0 -ffast-math "$@" -I"$root" $eigen "$here/sentences.cpp" 2>&1; }
  errors=$(fast | grep -E '(^|[ :])error:' || true)
  if [ "$(grep -c . <<<"$errors")" != 1 ] || ! grep -q 'liestat: .*-fno-finite-math-only' <<<"$errors" ||
    ! fast -fno-finite-math-only; then
    echo "$errors"
    echo "consumers: failed: -ffast-math is not answered by one sentence, or not accepted with -fno-finite-math-only" >&2
    exit 1
  fi
  echo "consumers: mistakes are answered by one sentence each"
fi

# Estimators of fusion/ in a program that links nothing: a call is answered by one sentence that names the target and the
# macro, and with the macro the program is whole.
# shellcheck disable=SC2086
estimators() { $CXX -std=c++20 "$@" -I"$root" $eigen "$here/fusion.cpp" 2>&1; }
trajectories=ON
printf '#include <boost/math/distributions.hpp>\n#include <Random123/philox.h>\n' | $CXX -std=c++20 -E -x c++ - >/dev/null 2>&1 ||
  trajectories=OFF
targets="fusion trajectories"
if [ $trajectories = OFF ]; then
  targets=
  echo "consumers: estimators: SKIPPED, Boost.Math or Random123 is not installed"
fi
errors=$(estimators -DHAND_EYE -c -o not_linked.o || true)
for target in $targets; do
  grep -q "liestat: link the CMake target liestat::$target, or define LIESTAT_HEADER_ONLY" <<<"$errors" || {
    echo "$errors"
    echo "consumers: failed: a call of an estimator that is not linked is not answered by a sentence" >&2
    exit 1
  }
done
if [ $trajectories = ON ]; then
  quietly estimators -DLIESTAT_HEADER_ONLY -o header_only
  built_and_ran ./header_only "in place, LIESTAT_HEADER_ONLY"
fi

quietly "$CMAKE" -S "$here/add_subdirectory" -B add_subdirectory -DLIESTAT_ROOT="$root"
quietly "$CMAKE" --build add_subdirectory
built_and_ran ./add_subdirectory/consumer "add_subdirectory"

quietly "$CMAKE" -S "$root" -B liestat -DCMAKE_INSTALL_PREFIX="$work/prefix" -DLIESTAT_BUILD_CLI=OFF \
  -DLIESTAT_BUILD_TESTS=OFF -DLIESTAT_BUILD_BENCHMARKS=OFF -DLIESTAT_BUILD_EXAMPLES=OFF
quietly "$CMAKE" --install liestat
# An installed tree that is moved must keep working: nothing in it may name the place it was installed to.
mv "$work/prefix" "$work/moved"
# The estimators for programs that compile them once (fusion/detail/compiled.hpp,
# stats/detail/compiled_mean.hpp).
for source in "$root"/fusion/compiled/*.cpp "$root"/stats/compiled/*.cpp "$root"/formats/*.cpp \
  "$root"/formats/detail/*.cpp; do
  quietly test -s "$work/moved/include/liestat/${source#"$root"/}"
done

quietly "$CMAKE" -S "$here/find_package" -B find_package -DCMAKE_PREFIX_PATH="$work/moved" -DTRAJECTORIES=$trajectories
cp "$work/log" "$work/configured"
quietly "$CMAKE" --build find_package
built_and_ran ./find_package/consumer "find_package"
built_and_ran ./find_package/compiled "find_package with components"
[ $trajectories = OFF ] || built_and_ran ./find_package/fusion "find_package with trajectories"
# The readers of files, where their packages are; where one is not, the configuration names it and goes on.
if [ -x find_package/formats ]; then
  built_and_ran ./find_package/formats "find_package with formats" "$root/examples/data/odometry.json"
else
  echo "consumers: formats: SKIPPED, $(grep -h 'liestat: formats needs' "$work/configured" || echo "it is not there")"
fi
quietly "$CMAKE" -S "$here/find_package" -B without_fmt -DCMAKE_PREFIX_PATH="$work/moved" \
  -DCMAKE_DISABLE_FIND_PACKAGE_fmt=ON
if ! grep -q 'liestat: formats needs fmt/core.h (Debian and Ubuntu: libfmt-dev)' "$work/log"; then
  cat "$work/log"
  echo "consumers: failed: a package that formats lacks is not named" >&2
  exit 1
fi
if "$CMAKE" -S "$here/find_package" -B bogus -DCMAKE_PREFIX_PATH="$work/moved" -DWANTED=bogus >"$work/log" 2>&1 ||
  ! grep -q 'There is no component bogus; there are means, estimation, laws, fusion' "$work/log"; then
  cat "$work/log"
  echo "consumers: failed: a component that there is not is not answered by the list of those that there are" >&2
  exit 1
fi

if ! command -v pkg-config >/dev/null; then
  echo "consumers: pkg-config: SKIPPED, it is not installed"
  exit 0
fi
export PKG_CONFIG_PATH="$work/moved/share/pkgconfig${PKG_CONFIG_PATH:+:$PKG_CONFIG_PATH}"
flags=$(pkg-config --cflags liestat)
# shellcheck disable=SC2086
quietly $CXX -std=c++20 $flags "$here/main.cpp" -o by_pkg_config
built_and_ran ./by_pkg_config "pkg-config"
