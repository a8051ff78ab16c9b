#!/usr/bin/env bash
# pages.sh ROOT : each path and link in ROOT's README.md, docs/*.md and docs/theory/*.md leads somewhere.
#
# A path begins with a folder of the project (lie/so3.hpp, examples/fuse_poses, cli/io/); a program may be named without
# .cpp, a pattern such as lie/*.hpp needs one match. A link is [text](page.md), with or without #heading. What leads
# nowhere is printed with page and line, and the exit code is 1. Before that the check is tried on a page with planted
# mistakes, each of which it must find.
set -eu

# check ROOT PAGES…: prints what is wrong, and fails if anything is.
check() {
  local root=$1 wrong=0 page place line path found target
  shift
  for page in "$@"; do
    while IFS=: read -r line path; do
      path=${path%%[.,:]}
      found=0
      for target in "$root/$path" "$root/$path.cpp" "$root"/$path; do
        if [ -e "$target" ]; then found=1; fi
      done
      if [ "$found" = 0 ]; then
        echo "${page#"$root"/}:$line: there is no $path"
        wrong=1
      fi
    done < <(grep -noP '(?<![\w./>-])(lie|stats|fusion|experiments|cli|tests|benchmarks|examples|fuzz|docs|cmake)/[\w.*/-]*' "$page")
    while IFS=: read -r line path; do
      path=${path#](}
      target=${path%%#*}
      place=$(dirname "$page")/$target
      if [ -z "$target" ]; then place=$page; fi
      if [ ! -e "$place" ]; then
        echo "${page#"$root"/}:$line: a link leads to $target, which does not exist"
        wrong=1
      elif [[ $path == *#* ]] && ! headings "$place" | grep -qxF -- "${path#*#}"; then
        echo "${page#"$root"/}:$line: $target has no heading #${path#*#}"
        wrong=1
      fi
    done < <(grep -noP '(?<=[^[])\]\((?!https?:)[^) ]+' "$page")
  done
  return $wrong
}

# The headings of a page as links name them: lower case, blanks as hyphens, no punctuation.
headings() {
  grep -P '^#+ ' "$1" | sed -E 's/^#+ +//; s/[^[:alnum:] _-]//g; s/ /-/g' | tr '[:upper:]' '[:lower:]'
}

planted=$(mktemp -d)
trap 'rm -rf "$planted"' EXIT
mkdir -p "$planted/docs" "$planted/lie" "$planted/examples"
touch "$planted/lie/so3.hpp" "$planted/examples/mean.cpp"
cat > "$planted/docs/page.md" <<'END'
# Two words, a heading
Here: `lie/so3.hpp`, `lie/*.hpp`, `lie/`, `#include <lie/so3.hpp>`, `examples/mean`, [here](page.md#two-words-a-heading).
Elsewhere: `build/release/lie/other.hpp`, https://example.org/lie/other.hpp
`lie/planted.hpp`
`stats/*.hpp`
<lie/planted_too.hpp>
[lost](planted.md)
[lost](page.md#planted)
END
if ! found=$(check "$planted" "$planted/docs/page.md"); then :; fi
if [ "$(cut -d: -f2 <<< "$found" | sort -n | xargs)" != "4 5 6 7 8" ]; then
  echo "the check itself is wrong; of the planted lines 4 to 8 it says:"
  echo "$found"
  exit 1
fi

check "$1" "$1"/README.md "$1"/docs/*.md "$1"/docs/theory/*.md
