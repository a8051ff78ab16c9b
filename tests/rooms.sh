#!/usr/bin/env bash
# rooms.sh ROOT : rooms call public names of the library.
#
#   cli/, python/, experiments/, examples/ and report/ name nothing in a namespace detail and include nothing of a folder
#   detail/; formats/ has such a folder and uses no other
#   views (cli/show/) include results, no estimator: no header that brings definitions with it (LIESTAT_HEADER_ONLY), but
#   for those of types
#
# Each violation is printed with file and line, and the exit code is 1. Before that the checks are tried on planted
# faults.
set -eu

# check ROOT: prints what is wrong, and fails if anything is.
check() {
  local root=$1 wrong=0 room header
  cd "$root"
  for room in cli python experiments examples report; do
    [ -d "$room" ] || continue
    # CLI11 has a namespace of that name, too.
    if grep -rnP --include='*.hpp' --include='*.cpp' \
      '(?<!CLI::)\bdetail::|namespace (\w+::)*detail\b|#include <(lie|stats|fusion|formats|report)/([\w/]*/)?detail/' "$room"; then
      wrong=1
    fi
  done
  # Whatever formats/ names in the namespace is declared in its own folder.
  if [ -d formats ]; then
    if grep -rnP '#include <(lie|stats|fusion|report)/([\w/]*/)?detail/' formats; then wrong=1; fi
    while IFS= read -r name; do
      if grep -rqsw "$name" --include='*.hpp' formats/detail; then continue; fi
      grep -rnw "detail::$name" formats
      wrong=1
    done < <(grep -rhoP '(?<!liestat::)\bdetail::\K\w+' formats | sort -u)
  fi
  while read -r header; do
    case $header in *_types.hpp) continue ;; esac
    if grep -rnF --include='*.hpp' --include='*.cpp' "#include <$header>" cli/show; then
      wrong=1
    fi
  done < <(grep -rlE --include='*.hpp' '^#if(def LIESTAT_HEADER_ONLY|ndef LIESTAT_COMPILED_)' lie stats fusion | grep -v /detail/)
  return "$wrong"
}

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir -p "$work"/{cli/show,lie,stats,fusion,formats/detail,python}
printf 'namespace liestat::detail {\nint ticks();\n}\n' >"$work/formats/detail/rows.hpp"
printf '#pragma once\n#ifdef LIESTAT_HEADER_ONLY\n#endif\n' | tee "$work/fusion/mean_types.hpp" >"$work/fusion/mean.hpp"
tried() {
  printf '%s\n' "$2" >"$work/$1"
  if (check "$work") >"$work/found"; then echo "the check finds no fault in: $2" && exit 1; fi
  rm "$work/$1"
}
tried python/a.cpp 'return liestat::detail::skew(v);'
tried python/a.cpp '  x = detail::skew(v);'
tried cli/a.hpp 'namespace detail {'
tried cli/a.hpp '#include <fusion/two_view/detail/b.hpp>'
tried cli/a.hpp '#include <lie/detail/b.hpp>'
tried cli/a.hpp '#include <formats/detail/rows.hpp>'
tried formats/a.cpp 'return detail::skew(v);'
tried formats/a.cpp '#include <lie/detail/small_matrix.hpp>'
tried cli/show/a.hpp '#include <fusion/mean.hpp>'
printf '#include <fusion/mean_types.hpp>\nCLI::detail::to_string(x);\n' >"$work/cli/show/a.hpp"
printf '#include <formats/detail/rows.hpp>\nreturn detail::ticks();\n' >"$work/formats/a.cpp"
(check "$work") || { echo "the check finds faults where there are none" && exit 1; }

check "$1"
