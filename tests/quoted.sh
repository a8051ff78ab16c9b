#!/usr/bin/env bash
# quoted.sh BUILD ROOT PAGE… : what pages say that commands print is what they print.
#
# A command is an indented line that begins with liestat, build/release/liestat, cat or ninja. Its output is quoted in the
# lines after it in the same block, or, where there are none, in the next indented block. A quotation may leave lines out
# and have … for what stands between two parts of a line; what it has must be printed in that order. The commands of a page
# run one after the other in one directory, the program and the examples are those of BUILD. Before that a page with
# planted mistakes is tried, each of which must be found.
set -euo pipefail

build=$(cd "$1" && pwd)
root=$(cd "$2" && pwd)
shift 2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# shellcheck disable=SC2317 # called by the commands of the pages
liestat() { "$build/liestat" "$@"; }
export build

# sections PAGE DIRECTORY: the commands of a page in files NUMBER.command, their quotations in NUMBER.quoted, and the line
# of each in NUMBER.line. Blank lines belong to the block around them.
sections() {
  awk -v directory="$2" '
    function isCommand(line) { return line ~ /^(liestat|build\/release\/liestat|cat|ninja) / }
    /^```/ { fenced = !fenced; next }
    fenced { next }
    /^    / {
      line = substr($0, 5)
      if (document) { print line > (directory "/" n ".command"); if (line == "END") document = 0; next }
      if (continued) { print line > (directory "/" n ".command"); continued = line ~ /\\$/; next }
      if (!inside) { inside = 1; of_command = 0 }
      if (isCommand(line)) {
        # Further commands before the quotation are of the same section.
        if (!pending) { ++n; print FNR > (directory "/" n ".line") }
        pending = 1
        print line > (directory "/" n ".command")
        if (line ~ /<<END$/) document = 1
        continued = line ~ /\\$/
        next
      }
      if (pending || of_command) { pending = 0; of_command = 1; print line > (directory "/" n ".quoted") }
      next
    }
    /^$/ { next }
    { inside = 0; of_command = 0; if (/^#/) pending = 0 }' "$1"
}

# quotes OUTPUT QUOTED: prints the first quoted line that OUTPUT does not have after those before it; nothing if it has all.
quotes() {
  awk '
    function matches(text, pattern,   parts, m, i, at) {
      m = split(pattern, parts, "…")
      for (i = 1; i <= m; ++i) {
        if (i == 1 && m == 1) return text == pattern
        at = index(text, parts[i])
        if (at == 0 || (i == 1 && at != 1)) return 0
        text = substr(text, at + length(parts[i]))
      }
      return parts[m] == "" || text == ""
    }
    function trimmed(line) { sub(/^ +/, "", line); sub(/ +$/, "", line); gsub(/ +/, " ", line); return line }
    FILENAME == ARGV[1] { output[++n] = trimmed($0); next }
    {
      pattern = trimmed($0)
      if (pattern == "" || pattern == "…") next
      do { ++at } while (at <= n && !matches(output[at], pattern))
      if (at > n) { print pattern; exit }
    }' "$1" "$2"
}

# check PAGE: prints what is wrong, and fails if anything is.
check() {
  local page=$1 directory=$2 number wrong=0 missing code
  mkdir -p "$directory/run/build"
  ln -s "$root/examples" "$directory/run/examples"
  ln -s "$build" "$directory/run/build/release"
  sections "$page" "$directory"
  for number in $(find "$directory" -maxdepth 1 -name '*.command' -printf '%f\n' | sort -n | sed 's/[.]command//'); do
    if [ ! -e "$directory/$number.quoted" ]; then continue; fi
    code=0
    # The programs are built already. An exit code up to 3 is a program's verdict on its result.
    sed -i -E 's/^ninja -C [^&]*&& //' "$directory/$number.command"
    # shellcheck source=/dev/null
    (cd "$directory/run" && set +e && . "$directory/$number.command") >"$directory/$number.output" 2>&1 || code=$?
    missing=$(quotes "$directory/$number.output" "$directory/$number.quoted")
    if [ -n "$missing" ] || [ "$code" -gt 3 ]; then
      echo "$(basename "$page"):$(cat "$directory/$number.line"): after exit code $code, not printed: $missing"
      wrong=1
    fi
    quoted=$((quoted + 1))
  done
  return $wrong
}

quoted=0
mkdir "$work/planted"
cat >"$work/planted/page.md" <<'END'
    cat examples/data/rotations.csv

    rx,ry,rz
    1.118618,…,0.508838

    cat examples/data/rotations.csv

    rx,ry,rz
    1.118618,…,0.508839

    cat examples/data/rotations.csv

in another order:

    1.118618,0.992338,0.508838
    rx,ry,rz
END
found=$(check "$work/planted/page.md" "$work/planted" || true)
if [ "$(grep -c 'not printed' <<<"$found")" != 2 ] || grep -q 'page.md:1:' <<<"$found"; then
  echo "quoted: the planted mistakes give:"
  echo "$found"
  exit 1
fi

failures=0
quoted=0
for page in "$@"; do
  mkdir "$work/$(basename "$page")"
  check "$root/$page" "$work/$(basename "$page")" || failures=1
done
if [ "$quoted" -eq 0 ]; then
  echo "quoted: no page quotes a command"
  exit 1
fi
if [ "$failures" -eq 0 ]; then echo "quoted: the output of $quoted commands is as quoted"; fi
exit "$failures"
