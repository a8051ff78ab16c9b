#!/usr/bin/env bash
# sqlite.sh SQLITE3 EXTENSION STATES: the extension of SQLite, run by the engine itself. States have the bytes that the
# library writes (STATES, of tests/stats/state_test.cpp) in any order and partition; bad input gives NULL or a sentence.
set -euo pipefail
sqlite=$1 extension=$2 states=$3

# run SQL: its output. Columns are Pythagorean, so that rows are unit quaternions without rounding to speak of.
run() {
  "$sqlite" :memory: 2>&1 <<SQL || true
.load $extension
create table t as with recursive i(n) as (select 0 union all select n + 1 from i where n < 1999)
  select n, (n * 29 % 1440) / 16.0 - 20 as deg,
         case n % 4 when 0 then 0.6 when 1 then 0.28 when 2 then 0 else 0.352 end x, 0.0 y,
         case n % 4 when 2 then 0.28 else 0 end z, case n % 4 when 0 then 0.8 when 3 then 0.936 else 0.96 end w from i;
$1
SQL
}
# shellcheck source=tests/engines/expect.sh
. "$(dirname "$0")/expect.sh"
hex() { od -An -v -tx1 "$states/$1" | tr -d ' \n' | tr a-f A-F; }

expect "the library's bytes" "=$(hex engine_headings.state)" "select hex(heading_state(deg)) from t;"
expect "the library's bytes" "=$(hex engine_rotations.state)" "select hex(rotation_state(x, y, z, w)) from t;"
shuffles=
for _ in 1 2 3 4 5 6 7 8 9 10; do
  shuffles+="select heading_state(deg) s from (select * from t order by random()) union all "
done
expect "one state" "=1" "select count(distinct hex(s)) from ($shuffles
  select liestat_merge(p) from (select heading_state(deg) p from t group by n % 7));"
pass="as materialized (select rotation_sums(x, y, z, w, (select s from"
passes="with a as materialized (select rotation_state(x, y, z, w) s from t), b $pass a)) s from t), c $pass b)) s from t),
  d $pass c)) s from t)"
expect "the chordal mean" '"status":"ok"' "select liestat_result(rotation_state(x, y, z, w)) from t;"
expect "a pass is missing" '"another_pass":1,"n":2000,"left_out":0,"status":"not_converged"' \
  "$passes select liestat_result(s) from b;"
expect "the Fréchet mean" '"another_pass":0,"n":2000,"left_out":0,"status":"ok"' "$passes select liestat_result(s) from d;"
expect "weights" "=1" "select abs(heading_mean(deg, 0.5) - heading_mean(deg)) < 1e-12 from t;"
expect "across north" "=0.0" "select min(heading_mean(d), 360 - heading_mean(d)) from (select 350 d union select 10);"
expect "headings that cancel" "=NULL" \
  "select ifnull(heading_mean(d), 'NULL') from (select 10 d union select 100 union select 190 union select 280);"
expect "no rows" "=NULL,NULL" \
  "select ifnull(heading_mean(deg), 'NULL') || ',' || ifnull(liestat_result(heading_state(deg)), 'NULL') from t where 0;"
expect "one row" '"status":"too_few"' "select liestat_result(heading_state(deg)) from t where n = 0;"
expect "bad rows" '"mean":[null,null],"covariance":[null],"n":0,"left_out":2000' \
  "select liestat_result(heading_state(case n % 3 when 0 then null when 1 then 'north' else 9e999 end)) from t;"
expect "a bad weight" "a weight is not finite, negative, or above" "select heading_mean(deg, n) from t;"
expect "no state" "not the bytes of a state" "select liestat_result(x'00');"
expect "states of two kinds" "do not merge" "select liestat_merge(s) from
  (select heading_state(deg) s from t union all select rotation_state(x, y, z, w) from t);"
expect "a reference of another feature" "do not merge" \
  "select heading_sums(deg, (select rotation_state(x, y, z, w) from t)) from t;"
exit $failed
