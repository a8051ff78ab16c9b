#!/usr/bin/env bash
# An optional package that is half installed switches off what needs it, and nothing else: the configuration goes through
# and its summary has one line for the package. Usage: half_packages.sh [WORK_DIRECTORY]; CXX and CMAKE are obeyed.
set -euo pipefail

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
CXX=${CXX:-c++}
CMAKE=${CMAKE:-cmake}
if [ -z "${CMAKE_GENERATOR:-}" ] && command -v ninja >/dev/null; then export CMAKE_GENERATOR=Ninja; fi
work=${1:-$(mktemp -d)}
# Begins anew, but deletes nothing that an earlier run, whose first configuration is in_pieces_error, has not made.
if [ -n "$(ls -A "$work" 2>/dev/null)" ] && [ ! -e "$work/in_pieces_error" ]; then
  echo "half_packages: $work holds other files, expected a directory of its own" >&2
  exit 2
fi
rm -rf "$work"
mkdir -p "$work"
work=$(cd "$work" && pwd)

# configure NAME ARGUMENTS…: from nothing, with the thorough tests, which alone need RapidCheck.
configure() {
  local name=$1
  shift
  "$CMAKE" -S "$root" -B "$work/$name" -DCMAKE_CXX_COMPILER="$CXX" -DLIESTAT_THOROUGH_TESTS=ON "$@" >"$work/$name.log" 2>&1 || {
    cat "$work/$name.log"
    echo "half_packages: the configuration '$name' failed" >&2
    exit 1
  }
}

# expect NAME PACKAGE…: each of the packages, and no other, is said to be there in part.
expect() {
  local name=$1
  shift
  local found
  found=$(sed -n 's/^-- *\([^ ]*\) (only a part of it is installed.*/\1/p' "$work/$name.log" | sort | tr '\n' ' ')
  local expected
  expected=$(printf '%s\n' "$@" | sort | tr '\n' ' ')
  if [ "$found" != "$expected" ]; then
    cat "$work/$name.log"
    echo "half_packages: in '$name' the summary names '$found', not '$expected'" >&2
    exit 1
  fi
}

# The packages found by modules: their names for CMake, and a target that the project links.
modules="TBB=TBB::tbb MPI=MPI::MPI_CXX Ceres=Ceres::ceres CLI11=CLI11::CLI11 fmt=fmt::fmt
  nlohmann_json=nlohmann_json::nlohmann_json yaml-cpp=yaml-cpp ZLIB=ZLIB::ZLIB rapidcheck=rapidcheck benchmark=benchmark::benchmark_main"
debian="libtbb-dev libopenmpi-dev libceres-dev libcli11-dev libfmt-dev nlohmann-json3-dev libyaml-cpp-dev zlib1g-dev
  librapidcheck-dev libbenchmark-dev"

# 1. A module that raises an error, as FindMPI did where Open MPI's programs were installed without its headers.
# 2. A target that links another which is not there: an error after the configuration, when the build is written.
# 3. A target whose library is not there: an error of the build.
mkdir -p "$work/error" "$work/target" "$work/library"
for pair in $modules; do
  module=${pair%%=*} target=${pair#*=}
  echo "message(FATAL_ERROR \"$module is in pieces\")" >"$work/error/Find$module.cmake"
  {
    echo "add_library($target INTERFACE IMPORTED)"
    echo "set_target_properties($target PROPERTIES INTERFACE_LINK_LIBRARIES nowhere::nothing)"
    echo "set(${module}_FOUND TRUE)"
    echo "set(MPI_CXX_FOUND TRUE)"
  } >"$work/target/Find$module.cmake"
  {
    echo "add_library($target SHARED IMPORTED)"
    echo "set_target_properties($target PROPERTIES IMPORTED_LOCATION /nowhere/lib.so)"
    echo "set(${module}_FOUND TRUE)"
    echo "set(MPI_CXX_FOUND TRUE)"
  } >"$work/library/Find$module.cmake"
done
for fault in error target library; do
  # shellcheck disable=SC2086 # a list of words
  configure "in_pieces_$fault" -DCMAKE_MODULE_PATH="$work/$fault"
  # shellcheck disable=SC2086
  expect "in_pieces_$fault" $debian
done

# 4. MPI's compiler without the rest of MPI. Where all of MPI is installed, CMake finds it in spite of the wrapper.
cat >"$work/mpicxx" <<'EOF'
#!/bin/sh
echo "Cannot open configuration file /usr/share/openmpi/mpic++-wrapper-data.txt" >&2
exit 1
EOF
chmod +x "$work/mpicxx"
configure wrapper -DMPI_CXX_COMPILER="$work/mpicxx"
echo "half_packages: fine"
