/* PostgreSQL extension: aggregates of headings, directions and rotations by states that merge (docs/postgresql.md). */
#include <postgres.h>

#include <access/htup_details.h>
#include <catalog/pg_type.h>
#include <fmgr.h>
#include <funcapi.h>
#include <math.h>
#include <utils/array.h>
#include <utils/builtins.h>

#include <stats/liestat_state.h>

PG_MODULE_MAGIC;

/* A group's memory. Rows are added sixteen at a time, which takes a third of the time. Sums also hold the state
 * whose mean they are taken at, which each row must name. */
enum { ROWS_WAITING = 16 };
typedef struct StateGroup {
  double rows[ROWS_WAITING][4], weights[ROWS_WAITING];
  int waiting, weighted;
  uint64_t state[LIESTAT_STATE_LARGEST / 8];
  bytea* after;
} StateGroup;

static void require(int code) {
  if (code != LIESTAT_STATE_OK) {
    ereport(ERROR, (errcode(ERRCODE_INVALID_PARAMETER_VALUE), errmsg("%s", liestat_state_error(code))));
  }
}
static void readBytes(const bytea* bytes, void* state) {
  require(liestat_state_read(state, VARDATA_ANY(bytes), VARSIZE_ANY_EXHDR(bytes)));
}
static StateGroup* groupOf(FunctionCallInfo fcinfo) {
  MemoryContext memory;
  if (!AggCheckCallContext(fcinfo, &memory)) elog(ERROR, "liestat: an aggregate's function was called outside of one");
  if (!PG_ARGISNULL(0)) return (StateGroup*)PG_GETARG_POINTER(0);
  return (StateGroup*)MemoryContextAllocZero(memory, sizeof(StateGroup));
}
/* The state with all of its rows; nothing if there are none. */
static const uint64_t* stateOf(StateGroup* group) {
  if (group == NULL || group->state[0] == 0) return NULL;
  require(liestat_state_add(group->state, group->rows[0], group->waiting, 4, group->weighted ? group->weights : NULL));
  group->waiting = 0;
  return group->state;
}
/* An empty state: moments, or sums at the mean of the state before, as the pass after that. */
static void begin(StateGroup* group, int manifold, const bytea* after) {
  uint64_t before[LIESTAT_STATE_LARGEST / 8];
  liestat_mean mean;
  if (after == NULL) return require(liestat_state_init(group->state, manifold, LIESTAT_MOMENTS, NULL, 0, 0));
  readBytes(after, before);
  require(liestat_state_finish(before, &mean));
  if (liestat_state_kind_of(before).manifold != manifold) require(LIESTAT_STATE_DIFFERENT);
  group->after = (bytea*)MemoryContextAlloc(GetMemoryChunkContext(group), VARSIZE_ANY(after));
  memcpy(group->after, after, VARSIZE_ANY(after));
  require(
      liestat_state_init(group->state, manifold, LIESTAT_SUMS, mean.mean, 0, liestat_state_kind_of(before).pass + 1));
}
/* Arguments: the group, a row's columns, its weight or none, of sums a state. NULL is a bad row, which is counted. */
static Datum step(FunctionCallInfo fcinfo, int manifold, int columns, int sums) {
  StateGroup* group = groupOf(fcinfo);
  const int last = PG_NARGS() - 1, weighted = last - sums > columns;
  const bytea* after = NULL;
  double* row;
  int i;
  if (sums && PG_ARGISNULL(last)) require(LIESTAT_STATE_FOREIGN);
  if (sums) after = PG_GETARG_BYTEA_PP(last);
  if (group->state[0] == 0) begin(group, manifold, after);
  if (sums &&
      (VARSIZE_ANY(after) != VARSIZE_ANY(group->after) || memcmp(after, group->after, VARSIZE_ANY(after)) != 0)) {
    require(LIESTAT_STATE_DIFFERENT);
  }
  row = group->rows[group->waiting];
  for (i = 0; i < columns; ++i) row[i] = PG_ARGISNULL(i + 1) ? NAN : PG_GETARG_FLOAT8(i + 1);
  if (manifold == LIESTAT_HEADING) liestat_heading(row[0], row);
  if (weighted) group->weights[group->waiting] = PG_ARGISNULL(columns + 1) ? NAN : PG_GETARG_FLOAT8(columns + 1);
  group->weighted = weighted;
  if (++group->waiting == ROWS_WAITING) stateOf(group);
  PG_RETURN_POINTER(group);
}
/* A manifold: its two aggregates' functions. The next one is a line, and its lines of SQL. */
#define LIESTAT_ROWS(name, manifold, columns)                                                  \
  PG_FUNCTION_INFO_V1(liestat_##name##_step);                                                  \
  Datum liestat_##name##_step(PG_FUNCTION_ARGS) { return step(fcinfo, manifold, columns, 0); } \
  PG_FUNCTION_INFO_V1(liestat_##name##_sums_step);                                             \
  Datum liestat_##name##_sums_step(PG_FUNCTION_ARGS) { return step(fcinfo, manifold, columns, 1); }
LIESTAT_ROWS(heading, LIESTAT_HEADING, 1)
LIESTAT_ROWS(direction, LIESTAT_DIRECTION, 3)
LIESTAT_ROWS(rotation, LIESTAT_ROTATION, 4)

static void merge(StateGroup* group, const void* other) {
  if (other == NULL) return;
  if (stateOf(group) == NULL) {
    memcpy(group->state, other, liestat_state_kind_of(other).size);
  } else {
    require(liestat_state_merge(group->state, other));
  }
}
PG_FUNCTION_INFO_V1(liestat_combine);
Datum liestat_combine(PG_FUNCTION_ARGS) {
  StateGroup* group = groupOf(fcinfo);
  if (!PG_ARGISNULL(1)) merge(group, stateOf((StateGroup*)PG_GETARG_POINTER(1)));
  PG_RETURN_POINTER(group);
}
PG_FUNCTION_INFO_V1(liestat_merge_step);
Datum liestat_merge_step(PG_FUNCTION_ARGS) {
  StateGroup* group = groupOf(fcinfo);
  uint64_t other[LIESTAT_STATE_LARGEST / 8];
  if (!PG_ARGISNULL(1)) {
    readBytes(PG_GETARG_BYTEA_PP(1), other);
    merge(group, other);
  }
  PG_RETURN_POINTER(group);
}
/* The state as bytes, NULL of no rows; between workers, and for the user. */
PG_FUNCTION_INFO_V1(liestat_bytes);
Datum liestat_bytes(PG_FUNCTION_ARGS) {
  const uint64_t* state = PG_ARGISNULL(0) ? NULL : stateOf((StateGroup*)PG_GETARG_POINTER(0));
  size_t size;
  bytea* bytes;
  if (state == NULL) PG_RETURN_NULL();
  size = liestat_state_kind_of(state).size;
  bytes = (bytea*)palloc(VARHDRSZ + size);
  SET_VARSIZE(bytes, VARHDRSZ + size);
  memcpy(VARDATA(bytes), state, size);
  PG_RETURN_BYTEA_P(bytes);
}
PG_FUNCTION_INFO_V1(liestat_group);
Datum liestat_group(PG_FUNCTION_ARGS) {
  StateGroup* group = (StateGroup*)palloc0(sizeof(StateGroup));
  readBytes(PG_GETARG_BYTEA_PP(0), group->state);
  PG_RETURN_POINTER(group);
}

static Datum arrayOf(const double* numbers, int n, bool* null) {
  Datum values[9];
  int i;
  *null = !isfinite(numbers[0]);
  if (*null) return (Datum)0;
  for (i = 0; i < n; ++i) values[i] = Float8GetDatum(numbers[i]);
  return PointerGetDatum(construct_array(values, n, FLOAT8OID, sizeof(float8), FLOAT8PASSBYVAL, TYPALIGN_DOUBLE));
}
static Datum numberOf(double number, bool* null) {
  *null = !isfinite(number);
  return Float8GetDatum(number);
}
static double degreesOf(const double* row) {
  const double angle = atan2(row[1], row[0]) * (180 / M_PI), turned = angle < 0 ? angle + 360 : angle;
  return turned < 360 ? turned : 0;
}
/* The mean of a state, as the composite type liestat_mean. */
static Datum result(FunctionCallInfo fcinfo, const void* state) {
  const int manifold = liestat_state_kind_of(state).manifold;
  Datum values[10];
  bool nulls[10] = {false};
  TupleDesc type;
  liestat_mean mean;
  require(liestat_state_finish(state, &mean));
  if (get_call_result_type(fcinfo, NULL, &type) != TYPEFUNC_COMPOSITE)
    elog(ERROR, "liestat: a record is no result here");
  values[0] = numberOf(manifold == LIESTAT_HEADING ? degreesOf(mean.mean) : NAN, &nulls[0]);
  values[1] = arrayOf(mean.mean, manifold + 1, &nulls[1]);
  values[2] = arrayOf(mean.covariance, manifold * manifold, &nulls[2]);
  values[3] = numberOf(mean.resultant, &nulls[3]);
  values[4] = numberOf(mean.step, &nulls[4]);
  values[5] = Int64GetDatum((int64)mean.n);
  values[6] = Int64GetDatum((int64)mean.left_out);
  values[7] = CStringGetTextDatum(mean.status);
  values[8] = CStringGetTextDatum(mean.reason);
  values[9] = BoolGetDatum(mean.another_pass != 0);
  PG_RETURN_DATUM(HeapTupleGetDatum(heap_form_tuple(BlessTupleDesc(type), values, nulls)));
}
PG_FUNCTION_INFO_V1(liestat_result);
Datum liestat_result(PG_FUNCTION_ARGS) {
  uint64_t state[LIESTAT_STATE_LARGEST / 8];
  readBytes(PG_GETARG_BYTEA_PP(0), state);
  return result(fcinfo, state);
}
PG_FUNCTION_INFO_V1(liestat_mean_of_group);
Datum liestat_mean_of_group(PG_FUNCTION_ARGS) {
  const uint64_t* state = PG_ARGISNULL(0) ? NULL : stateOf((StateGroup*)PG_GETARG_POINTER(0));
  if (state == NULL) PG_RETURN_NULL();
  return result(fcinfo, state);
}
PG_FUNCTION_INFO_V1(liestat_degrees_of_group);
Datum liestat_degrees_of_group(PG_FUNCTION_ARGS) {
  const uint64_t* state = PG_ARGISNULL(0) ? NULL : stateOf((StateGroup*)PG_GETARG_POINTER(0));
  liestat_mean mean;
  if (state == NULL) PG_RETURN_NULL();
  require(liestat_state_finish(state, &mean));
  if (!isfinite(mean.mean[0])) PG_RETURN_NULL();
  PG_RETURN_FLOAT8(degreesOf(mean.mean));
}
