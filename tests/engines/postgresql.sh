#!/usr/bin/env bash
# postgresql.sh PG_CONFIG LIBRARIES STATES: the extension of PostgreSQL, built against the library in LIBRARIES and run by a
# server of its own. States have the bytes that the library writes (STATES, of tests/stats/state_test.cpp) in any order,
# partition and number of workers; bad input gives NULL or a sentence.
set -euo pipefail
config=$1 libraries=$2 states=$3
source=$(cd "$(dirname "$0")/../../engines/postgresql" && pwd)
binaries=$("$config" --bindir)
directory=$(mktemp -d)
as_user=()
# The server refuses to run as root.
if [ "$(id -u)" = 0 ]; then as_user=(setpriv --reuid=postgres --regid=postgres --clear-groups); fi
stop() {
  "${as_user[@]}" "$binaries/pg_ctl" -D "$directory/run/data" -m fast stop >/dev/null 2>&1 || true
  rm -rf "$directory"
}
trap stop EXIT
make -s -C "$directory" -f "$source/Makefile" VPATH="$source" PG_CONFIG="$config" with_llvm=no LIESTAT="$libraries"
# Where PostgreSQL's directories cannot be written, the SQL names the module by its path.
sed "s#MODULE_PATHNAME#$directory/liestat#g; /^.echo/d" "$source/liestat--0.2.sql" >"$directory/liestat.sql"
mkdir "$directory/run"
chmod 755 "$directory"
if [ "$(id -u)" = 0 ]; then chown postgres "$directory/run"; fi
"${as_user[@]}" "$binaries/initdb" -D "$directory/run/data" -A trust -U postgres --no-sync >/dev/null
"${as_user[@]}" "$binaries/pg_ctl" -D "$directory/run/data" -w -l "$directory/run/log" \
  -o "-c listen_addresses='' -k $directory/run" start >/dev/null
# run SQL: its output, values alone.
run() { "$binaries/psql" -h "$directory/run" -U postgres -qAtX -v ON_ERROR_STOP=0 2>&1 <<<"$1" || true; }
"$binaries/psql" -h "$directory/run" -U postgres -qX -v ON_ERROR_STOP=1 -f "$directory/liestat.sql"
run "create table t as select n, (n * 29 % 1440) / 16.0::float8 - 20 as deg,
  case n % 4 when 0 then 0.6 when 1 then 0.28 when 2 then 0 else 0.352 end::float8 x, 0::float8 y,
  case n % 4 when 2 then 0.28 else 0 end::float8 z,
  case n % 4 when 0 then 0.8 when 3 then 0.936 else 0.96 end::float8 w from generate_series(0, 1999) n;
  create table shuffled as select * from t order by random(); analyze t; analyze shuffled;"
# shellcheck source=tests/engines/expect.sh
. "$(dirname "$0")/expect.sh"
hex() { od -An -v -tx1 "$states/$1" | tr -d ' \n'; }

expect "the library's bytes" "=$(hex engine_headings.state)" "select encode(heading_state(deg), 'hex') from t"
rotations=$(hex engine_rotations.state)
expect "the library's bytes" "=$rotations" "select encode(rotation_state(x, y, z, w), 'hex') from t"
expect "any order" "=$rotations" "select encode(rotation_state(x, y, z, w), 'hex') from shuffled"
expect "any partition" "=$rotations" \
  "select encode(liestat_merge(s), 'hex') from (select rotation_state(x, y, z, w) s from t group by n % 7) q"
parallel="set parallel_setup_cost = 0; set parallel_tuple_cost = 0; set min_parallel_table_scan_size = 0;"
for workers in 1 2; do
  set_workers="$parallel set max_parallel_workers_per_gather = $workers;"
  expect "$workers workers" "Workers Launched: $workers" \
    "$set_workers explain (analyze) select rotation_state(x, y, z, w) from shuffled"
  expect "$workers workers" "=$rotations" "$set_workers select encode(rotation_state(x, y, z, w), 'hex') from shuffled"
  expect "$workers workers, sums" "=t" "$set_workers create temporary table sums$workers as
    select rotation_sums(x, y, z, w, (select rotation_state(x, y, z, w) from t)) s from shuffled;
    set max_parallel_workers_per_gather = 0;
    select s = (select rotation_sums(x, y, z, w, (select rotation_state(x, y, z, w) from t)) from t) from sums$workers"
done
expect "the chordal mean" "=ok|2000|0|t" "select (m).status, (m).n, (m).left_out, (m).resultant > 0.9 from
  (select rotation_mean(x, y, z, w) m from t) q"
expect "the Fréchet mean" "=ok|2000|4|f" "select (result).status, (result).n, passes, (result).another_pass
  from frechet_mean('rotation', 'x, y, z, w', 't')"
expect "of a query, weighted" "=ok|1000" "select (result).status, (result).n
  from frechet_mean('rotation', 'x, y, z, w, 0.5', '(select * from t where n < 1000) q')"
expect "directions" "=ok|1000" "select (m).status, (m).n from
  (select direction_mean(cos(n * 0.0003), sin(n * 0.0003) * 0.6, sin(n * 0.0003) * 0.8) m from t where n % 2 = 0) q"
expect "weights" "=t" "select abs(heading_mean(deg, 0.5) - heading_mean(deg)) < 1e-12 from t"
expect "groups" "=7" "select count(heading_mean) from (select heading_mean(deg) from t group by n % 7) q"
expect "a window" "=340|340.90625|342.71875" "select string_agg(h::text, '|') from
  (select heading_mean(deg) over (order by n rows 1 preceding) h from t where n < 3 order by n) q"
expect "across north" "=t" "select least(h, 360 - h) < 1e-12 from (select heading_mean(d) h from (values (350.0), (10)) v(d)) q"
expect "headings that cancel" "=t" "select heading_mean(d) is null from (values (10.0), (100), (190), (280)) v(d)"
expect "no rows" "=t|t" "select heading_mean(deg) is null, rotation_mean(x, y, z, w) is null from t where false"
expect "no rows" "=|1" "select result, passes from frechet_mean('heading', 'deg', 't where false')"
expect "one row" "=too_few" "select (liestat_result(heading_state(deg))).status from t where n = 0"
expect "bad rows" "=0|2000|t" "select (m).n, (m).left_out, (m).mean is null from (select
  liestat_result(heading_state(case n % 3 when 0 then null when 1 then 'NaN' else 'Infinity' end::float8)) m from t) q"
expect "a bad weight" "a weight is not finite, negative, or above" "select heading_mean(deg, n) from t"
expect "a weight of NULL" "a weight is not finite, negative, or above" "select heading_mean(deg, null) from t"
expect "no state" "not the bytes of a state" "select liestat_result('\\x00')"
expect "a state of a newer version" "newer version" \
  "select liestat_result(set_byte(heading_state(deg), 7, 2)) from t"
expect "states of two kinds" "do not merge" "select liestat_merge(s) from
  (select heading_state(deg) s from t union all select rotation_state(x, y, z, w) from t) q"
expect "mixed references" "do not merge" "select heading_sums(deg, case when n < 3 then a else b end) from t,
  (select heading_state(deg) a from t) q, (select heading_state(deg) b from t where n < 7) r"
expect "no reference" "not the bytes of a state" "select heading_sums(deg, null) from t"
expect "a feature that is none" "none of heading, direction, rotation" "select frechet_mean('point', 'a', 't')"
exit $failed
