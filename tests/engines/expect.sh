# expect WHAT EXPECTED SQL, for the tests of engines: the output of `run SQL` contains EXPECTED; = before it: it is that.
# What differs is named, and sets `failed`.
failed=0
expect() {
  local output
  output=$(run "$3")
  case $2 in
    =*) [ "$output" = "${2#=}" ] && return ;;
    *) [[ $output == *"$2"* ]] && return ;;
  esac
  echo "$(basename "$0"): $1: found '$output', expected '$2'" >&2
  failed=1
}
