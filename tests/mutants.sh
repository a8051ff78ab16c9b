#!/usr/bin/env bash
# Which tests find which faults: planted faults of mutants.txt, all in one build, one of them switched on in each run.
#
#   tests/mutants.sh                    everything: a day of one processor, resumed where it was stopped
#   tests/mutants.sh --tests lie/       the tests whose programs match, and only these are built
#   tests/mutants.sh --only lie/se3     the faults whose file, kind or text match
#   tests/mutants.sh --check            every entry of mutants.txt matches its file once; takes seconds, needs awk alone
#   tests/mutants.sh --help             the other options (mutants.py; Python 3.9 or later, nothing besides)
#
# Results are in build/mutants/: results.jsonl (each run), matrix.csv (fault by test), report.md (for docs/design.md).
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

if [ "${1:-}" != --check ]; then
  exec python3 "$root/tests/mutants.py" "$@"
fi

# As mutants.py reads the list: blanks do not count, so that a formatter may break lines as it likes.
cd "$root"
LC_ALL=C awk '
  function wrong(text) {
    print "tests/mutants.txt:" NR ": " text
    errors++
  }
  function occurrences(text, part,    count, at) {
    for (count = 0; (at = index(text, part)) > 0; count++) text = substr(text, at + 1)
    return count
  }
  /^[ \t]*(#|$)/ { next }
  /^\[.*\]$/ {
    file = substr($0, 2, length($0) - 2)
    source = ""
    while ((getline line < file) > 0) source = source line
    close(file)
    gsub(/[ \t\r]/, "", source)
    if (source == "") wrong("there is no " file)
    next
  }
  {
    entries++
    from = index($0, ": ")
    to = 0
    for (rest = $0; (at = index(rest, " =>")) > 0; rest = substr(rest, at + 3)) to += at + (to > 0 ? 2 : 0)
    original = substr($0, from + 2, to - from - 2)
    if (from == 0 || to <= from || gsub(/«/, "", original) != 1 || gsub(/»/, "", original) != 1) {
      wrong("expected kind: text with one «part» => other part")
      next
    }
    gsub(/[ \t]/, "", original)
    if (seen[file, $0]++) wrong("twice: " $0)
    if (source != "" && (count = occurrences(source, original)) != 1) wrong(file " has it " count " times: " $0)
  }
  END {
    if (entries == 0) wrong("no entry")
    exit errors > 0
  }
' tests/mutants.txt
