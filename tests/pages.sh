#!/usr/bin/env bash
# pages.sh ROOT : each path and link in ROOT's *.md, docs/*.md and docs/theory/*.md leads somewhere, and so does each
# citation of a page's section in ROOT's *.hpp, *.cpp and *.md.
#
# A path begins with a folder of the project (lie/so3.hpp, examples/fuse_poses, formats/); a program may be named without
# .cpp, a pattern such as lie/*.hpp needs one match. A link is [text](page.md), with or without #heading. A citation is
# page.md, section 4.2 (or sections 4 and 4.2), the page relative to ROOT or to docs, with a heading of each number; it may
# go on in the next line. Bold text must not begin with code or a formula, which Doxygen does not recognise. What is wrong
# is printed with file and line, and the exit code is 1. Before that the checks are tried on files with planted mistakes,
# each of which they must find.
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
    # shellcheck disable=SC2016 # a pattern
    while IFS=: read -r line path; do
      echo "${page#"$root"/}:$line: the site shows ** as it stands before $path"
      wrong=1
    done < <(grep -noP '(?<![\w*])\*\*(?=[`$])[`$][^`$]*[`$]?' "$page")
  done
  return $wrong
}

# checkCitations ROOT: prints which citations of ROOT's sources and pages lead nowhere, and fails if any does.
checkCitations() {
  local root=$1 wrong=0 file line text page place target number
  while IFS=$'\t' read -r file line text; do
    page=${text%%.md*}.md
    target=
    for place in "$root/docs/$page" "$root/$page"; do
      if [ -f "$place" ]; then target=$place; fi
    done
    if [ -z "$target" ]; then
      echo "${file#"$root"/}:$line: $page is cited, which is neither in the project nor in its docs"
      wrong=1
      continue
    fi
    while read -r number; do
      if ! grep -qP "^#+ \Q$number\E\.? " "$target"; then
        echo "${file#"$root"/}:$line: $page has no section $number"
        wrong=1
      fi
    done < <(grep -oP '\d+(\.\d+)*' <<< "${text#*.md}")
  done < <(find "$root" -mindepth 1 \( -name build -o -name '.*' \) -prune -o \
    -type f \( -name '*.hpp' -o -name '*.cpp' -o -name '*.md' \) -print0 | citations)
  return $wrong
}

# citations: reads names of files, each ended by a zero byte, and prints file, line and text of each citation. A line is
# read together with the one after it, whose comment mark does not count.
citations() {
  # shellcheck disable=SC2016 # awk's variables
  xargs -0 awk '
    function find(line, next_line,  text, at, begin) {
      text = line " " next_line
      at = 0
      while (match(substr(text, at + 1), cited)) {
        begin = at + RSTART
        if (begin > length(line)) return
        print name "\t" number "\t" substr(text, begin, RLENGTH)
        at = begin + RLENGTH - 1
      }
    }
    BEGIN {
      n = "[0-9]+(\\.[0-9]+)*"
      cited = "[A-Za-z0-9_./-]+\\.md,? (section " n "|sections " n "((, | and | to )" n ")*)"
    }
    FNR == 1 { if (NR > 1) find(line, ""); line = ""; name = FILENAME; number = 0 }
    {
      text = $0
      sub(/^[ \t]*(\/\/[\/!]*[ \t]*)?/, "", text)
      if (number > 0) find(line, text)
      line = text; name = FILENAME; number = FNR
    }
    END { find(line, "") }'
}

# The headings of a page as links name them: lower case, blanks as hyphens, no punctuation.
headings() {
  grep -P '^#+ ' "$1" | sed -E 's/^#+ +//; s/[^[:alnum:] _-]//g; s/ /-/g' | tr '[:upper:]' '[:lower:]'
}

planted=$(mktemp -d)
trap 'rm -rf "$planted"' EXIT
mkdir -p "$planted/docs/theory" "$planted/lie" "$planted/examples"
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
**`bold`** and 2**`n`
END
if ! found=$(check "$planted" "$planted/docs/page.md"); then :; fi
if [ "$(cut -d: -f2 <<< "$found" | sort -n | xargs)" != "4 5 6 7 8 9" ]; then
  echo "the check itself is wrong; of the planted lines 4 to 9 it says:"
  echo "$found"
  exit 1
fi

cat > "$planted/docs/theory/page.md" <<'END'
# A title
## 4. Four
### 4.2 Four, two
### 11. Eleven
END
cat > "$planted/lie/so3.hpp" <<'END'
// Right: docs/theory/page.md, section 4.2, theory/page.md section 4. (docs/theory/page.md,
// section 11), and of docs/theory/page.md, sections 4, 4.2 and 11; a report, section 7, is no page.
/// docs/theory/page.md, section 4.3
// theory/planted.md, section 4, and docs/theory/page.md, section
/// 1.
int two = 2;  // docs/page.md, section 4; page.md, section 2
// docs/theory/page.md, sections 4.2 and 5
// planted.md,
// section 4
END
if ! found=$(checkCitations "$planted"); then :; fi
if [ "$(cut -d: -f2 <<< "$found" | xargs)" != "3 4 4 6 6 7 8" ]; then
  echo "the check of citations is wrong itself; of the planted lines 3, 4 (twice), 6 (twice), 7 and 8 it says:"
  echo "$found"
  exit 1
fi

wrong=0
check "$1" "$1"/*.md "$1"/docs/*.md "$1"/docs/theory/*.md || wrong=1
checkCitations "$1" || wrong=1
exit $wrong
