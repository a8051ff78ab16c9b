#!/usr/bin/env bash
# What each public header costs whoever includes it: lines after preprocessing, and milliseconds of processor time that
# the compilers take to parse a unit with nothing else in it (best of three). The list is that of the tests of the headers.
# EIGEN_INCLUDE_DIR says where Eigen is when it is in no standard place.
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

# milliseconds COMPILER HEADER: - where it doesn't compile, for want of a package.
milliseconds() {
  local best=- took
  local TIMEFORMAT='%3U'
  for _ in 1 2 3; do
    took=$({ time "$1" "${flags[@]}" -include "$2" -fsyntax-only - </dev/null 2>/dev/null || echo failed; } 2>&1)
    case $took in
      *failed*)
        echo -
        return
        ;;
    esac
    took=$((10#${took//[.,]/}))
    if [ "$best" = - ] || [ "$took" -lt "$best" ]; then best=$took; fi
  done
  echo "$best"
}

lines() { { echo "#include <$1>" | "${compilers[0]}" "${flags[@]}" -E -P - 2>/dev/null || true; } | wc -l; }

printf '| %-30s | %7s |' header lines
printf ' %10s |' "${compilers[@]/%/ ms}"
printf '\n|%s|%s:|' "$(printf -- '-%.0s' {1..32})" "$(printf -- '-%.0s' {1..8})"
for _ in "${compilers[@]}"; do printf '%s:|' "$(printf -- '-%.0s' {1..11})"; done
printf '\n'
# What the library stands on comes first, to compare with.
{
  printf 'Eigen/Core\nEigen/Geometry\nEigen/Dense\n'
  {
    sed -e 's/#.*//' -e '/^ *$/d' "$root/tests/headers.txt" | awk '{ print $1 }'
    sed -n 's/^[a-z0-9_]*;\(lie[^;]*\);.*/\1/p' "$root/tests/manifolds.txt"
  } | sort -u
} | while read -r header; do
  printf '| %-30s | %7s |' "$header" "$(lines "$header" </dev/null)"
  for compiler in "${compilers[@]}"; do printf ' %10s |' "$(milliseconds "$compiler" "$header" </dev/null)"; done
  printf '\n'
done
