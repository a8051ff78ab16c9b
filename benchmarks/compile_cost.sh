#!/usr/bin/env bash
# What each public header costs whoever includes it: lines after preprocessing, and milliseconds of processor time that
# the compilers take for a unit with nothing else in it (best of three; one if it takes ten seconds), with the estimators
# in the headers and with liestat::means and liestat::fusion linked. Then the same of units that call an estimator. The
# list of headers is that of their tests; HEADER… as arguments stand for it. EIGEN_INCLUDE_DIR says where Eigen is when it is in
# no standard place.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
flags=(-std=c++20 -O2 -x c++ -I "$root")
for directory in "${EIGEN_INCLUDE_DIR:-}" /usr/include/eigen3 /usr/local/include/eigen3; do
  if [ -n "$directory" ] && [ -d "$directory" ]; then flags+=(-isystem "$directory"); fi
done
if command -v mpicxx >/dev/null; then
  # Open MPI's wrapper prints what it would add; others don't know the option, and their headers stay out of the table.
  read -ra mpi <<<"$(mpicxx --showme:compile 2>/dev/null || true)"
  flags+=("${mpi[@]}")
fi

compilers=()
for compiler in "${CXX:-g++}" clang++; do
  if command -v "$compiler" >/dev/null; then compilers+=("$compiler"); fi
done
[ ${#compilers[@]} -gt 0 ] || { echo "compile_cost: no compiler" >&2; exit 2; }

header_only="-DLIESTAT_HEADER_ONLY"
linked="-DLIESTAT_COMPILED_MEANS -DLIESTAT_COMPILED_ESTIMATION -DLIESTAT_COMPILED_FUSION -DLIESTAT_COMPILED_TRAJECTORIES"

# milliseconds COMPILER [FLAGS…]: of a unit on standard input; - where it doesn't compile, for want of a package.
milliseconds() {
  local best=- took unit
  local TIMEFORMAT='%3U'
  unit=$(cat)
  for _ in 1 2 3; do
    took=$({ time "$@" "${flags[@]}" - <<<"$unit" 2>/dev/null || echo failed; } 2>&1)
    case $took in
      *failed*)
        echo -
        return
        ;;
    esac
    took=$((10#${took//[.,]/}))
    if [ "$best" = - ] || [ "$took" -lt "$best" ]; then best=$took; fi
    [ "$took" -lt 10000 ] || break
  done
  echo "$best"
}

lines() { { "${compilers[0]}" "${flags[@]}" -E -P - 2>/dev/null || true; } | wc -l; }

# row NAME UNIT [FLAGS…]
row() {
  local name=$1 unit=$2 compiler
  shift 2
  printf '| %-38s | %7s |' "$name" "$(lines <<<"$unit")"
  for compiler in "${compilers[@]}"; do
    printf ' %10s |' "$(milliseconds "$compiler" "$@" $header_only <<<"$unit")"
    # shellcheck disable=SC2086 # several flags in one variable
    printf ' %17s |' "$(milliseconds "$compiler" "$@" $linked <<<"$unit")"
  done
  printf '\n'
}

# head WHAT
head() {
  printf '| %-38s | %7s |' "$1" lines
  for compiler in "${compilers[@]}"; do printf ' %10s | %17s |' "$compiler ms" "$compiler, linked"; done
  printf '\n|%s|%s:|' "$(printf -- '-%.0s' {1..40})" "$(printf -- '-%.0s' {1..8})"
  for _ in "${compilers[@]}"; do printf '%s:|%s:|' "$(printf -- '-%.0s' {1..11})" "$(printf -- '-%.0s' {1..18})"; done
  printf '\n'
}

headers() {
  if [ $# -gt 0 ]; then
    printf '%s\n' "$@"
    return
  fi
  # Eigen comes first, to compare with.
  printf 'Eigen/Core\nEigen/Geometry\nEigen/Dense\n'
  {
    sed -e 's/#.*//' -e '/^ *$/d' "$root/tests/headers.txt" | awk '{ print $1 }'
    sed -n 's/^[a-z0-9_]*;\(lie[^;]*\);.*/\1/p' "$root/tests/manifolds.txt"
  } | sort -u
}

head header
headers "$@" | while read -r header; do row "$header" "#include <$header>" -fsyntax-only; done

printf '\n'
head 'unit that calls, -O2'
rotations='#include <lie/so3.hpp>
#include <vector>
using Rotations = std::vector<liestat::SO3d>;'
row 'mean(rotations)' "$rotations
#include <stats/mean.hpp>
auto f(const Rotations& rotations) { return liestat::mean(rotations); }" -c -o /dev/null
row 'certifiedMean(rotations)' "$rotations
#include <stats/certified_mean.hpp>
auto f(const Rotations& rotations) { return liestat::certifiedMean(rotations); }" -c -o /dev/null
row 'initialiseRecording(recording, {})' '#include <fusion/visual_inertial.hpp>
auto f(const liestat::VisualInertialRecording& recording) { return liestat::initialiseRecording(recording, {}); }' \
  -c -o /dev/null
row 'estimateTwoViewMotion(matches, {})' '#include <fusion/two_view/two_view.hpp>
auto f(std::span<const Eigen::Vector4d> matches) { return liestat::estimateTwoViewMotion(matches, {}); }' \
  -c -o /dev/null
