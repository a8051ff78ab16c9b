#!/usr/bin/env bash
# Runs a compiler and fails when what it read matches a pattern: only_granted.sh HEADER ROOT PATTERN COMPILER ARGS…
set -euo pipefail
header=$1 root=$2 pattern=$3
shift 3
"$@"
depfile=
previous=
for argument in "$@"; do
  [ "$previous" = -MF ] && depfile=$argument
  previous=$argument
done
# A generator that asks for no list of dependencies gives nothing to check.
[ -n "$depfile" ] && [ -f "$depfile" ] || exit 0
# shellcheck disable=SC1003 # a backslash ends the list's lines
found=$(tr -s '[:space:]\\' '\n' <"$depfile" | grep -v "^$root/" | grep -E -m 1 -e "$pattern" || true)
if [ -n "$found" ]; then
  echo "$header includes $found, a package which tests/headers.txt (manifolds.txt) does not grant it" >&2
  exit 1
fi
