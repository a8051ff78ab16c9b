#!/usr/bin/env bash
# statuses.sh ROOT : docs/statuses.md has every status, and tests/status_doors.txt every result with one.
set -euo pipefail

# enumerators HEADER ENUM
enumerators() {
  sed -n "/^enum class $2 {/,/^};/p" "$1" | sed 's@//.*@@' | grep -oE '^ +[a-z_]+' | tr -d ' '
}

# doors ROOT: the structs and classes of public headers that have a member or an accessor of a status.
doors() {
  find "$1/stats" "$1/fusion" -name '*.hpp' -not -path '*/detail/*' -not -path '*/compat/*' -print0 | sort -z | xargs -0 awk '
    /^(struct|class) [A-Za-z]+/ { result = $2 }
    /^ +[A-Za-z]*Status (status =|status;|status\(\) const)/ && !/constexpr/ { print result }' | grep -v '^$' | sort -u
}

# check ROOT: prints what is missing, and fails if anything is.
check() {
  local root=$1 wrong=0 header enum status door test
  while read -r header enum; do
    while read -r status; do
      if ! grep -q "^|.*\`$status\`" "$root/docs/statuses.md"; then
        echo "docs/statuses.md: no row for $enum::$status of $header"
        wrong=1
      fi
    done < <(enumerators "$root/$header" "$enum")
  done <<<"stats/status.hpp Status
stats/constrained_types.hpp ConstrainedEnd
stats/implicit_ekf_types.hpp FilterStatus
fusion/status.hpp FusionStatus
fusion/evaluate_types.hpp EvaluationStatus"
  while read -r door; do
    if ! grep -qE "^$door ([a-z_/]+_test$|- .)" "$root/tests/status_doors.txt"; then
      echo "tests/status_doors.txt: $door has a status; which test gives it noise that is stated too small, or why none?"
      wrong=1
    fi
  done < <(doors "$root")
  while read -r door test _; do
    case $door in '' | '#') continue ;; esac
    if ! doors "$root" | grep -qx "$door"; then
      echo "tests/status_doors.txt: $door is no result with a status"
      wrong=1
    elif [ "$test" != - ] && [ ! -f "$root/tests/$test.cpp" ]; then
      echo "tests/status_doors.txt: $door: no tests/$test.cpp"
      wrong=1
    fi
  done <"$root/tests/status_doors.txt"
  return "$wrong"
}

# A check that finds nothing in planted faults would find nothing at all.
planted=$(mktemp -d)
trap 'rm -rf "$planted"' EXIT
mkdir -p "$planted/tests" "$planted/docs"
cp -r "$1/stats" "$1/fusion" "$planted"
cp "$1/tests/status_doors.txt" "$planted/tests"
cp "$1/docs/statuses.md" "$planted/docs"
sed -i 's/^  ok,/  ok,\n  planted,/' "$planted/stats/status.hpp"
printf 'struct PlantedResult {\n  Status status = Status::ok;\n};\n' >"$planted/stats/planted.hpp"
found=$(check "$planted" || true)
grep -q 'Status::planted' <<<"$found" && grep -q PlantedResult <<<"$found" || {
  echo "statuses.sh does not see planted faults"
  exit 1
}
check "$1"
