/* SQLite extension: aggregates of headings, directions and rotations by states that merge (docs/sqlite.md). */
#include <sqlite3ext.h>
SQLITE_EXTENSION_INIT1

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <stats/liestat_state.h>

/* A manifold by its columns in SQL. The next one is a line of this table. */
typedef struct Rows {
  const char* name;
  int manifold, columns, numbers;
} Rows;
static const Rows all_rows[] = {
    {"heading", LIESTAT_HEADING, 1, 2}, {"direction", LIESTAT_DIRECTION, 3, 3}, {"rotation", LIESTAT_ROTATION, 4, 4}};

typedef struct Memory {
  uint64_t state[LIESTAT_STATE_LARGEST / 8];
} Memory;

static double number(sqlite3_value* value) {
  int type = sqlite3_value_type(value);
  if (type == SQLITE_FLOAT) return sqlite3_value_double(value);
  type = sqlite3_value_numeric_type(value);
  return type == SQLITE_INTEGER || type == SQLITE_FLOAT ? sqlite3_value_double(value) : NAN;
}
static void complain(sqlite3_context* context, int code) {
  if (code != LIESTAT_STATE_OK) sqlite3_result_error(context, liestat_state_error(code), -1);
}
/* A state from a blob, which must be aligned to be read from. */
static int readState(sqlite3_value* value, void* state) {
  if (sqlite3_value_type(value) != SQLITE_BLOB) return LIESTAT_STATE_FOREIGN;
  return liestat_state_read(state, sqlite3_value_blob(value), (size_t)sqlite3_value_bytes(value));
}
/* An empty state: moments, or sums at the mean of the state in the last argument, as the pass after that. */
static int begin(const Rows* rows, int sums, sqlite3_value* before, void* state) {
  uint64_t previous[LIESTAT_STATE_LARGEST / 8];
  liestat_mean mean;
  int code;
  if (!sums) return liestat_state_init(state, rows->manifold, LIESTAT_MOMENTS, NULL, 0, 0);
  if ((code = readState(before, previous)) != LIESTAT_STATE_OK) return code;
  if ((code = liestat_state_finish(previous, &mean)) != LIESTAT_STATE_OK) return code;
  if (liestat_state_kind_of(previous).manifold != rows->manifold) return LIESTAT_STATE_DIFFERENT;
  return liestat_state_init(state, rows->manifold, LIESTAT_SUMS, mean.mean, 0, liestat_state_kind_of(previous).pass + 1);
}

static void step(sqlite3_context* context, int n, sqlite3_value** values, int sums) {
  const Rows* rows = (const Rows*)sqlite3_user_data(context);
  Memory* memory = (Memory*)sqlite3_aggregate_context(context, sizeof *memory);
  const int weighted = n - sums > rows->columns;
  double row[4], weight = 1;
  int i, code = LIESTAT_STATE_OK;
  if (memory == NULL) return sqlite3_result_error_nomem(context);
  if (memory->state[0] == 0) code = begin(rows, sums, values[n - 1], memory->state);
  if (code != LIESTAT_STATE_OK) return complain(context, code);
  for (i = 0; i < rows->columns; ++i) row[i] = number(values[i]);
  if (rows->manifold == LIESTAT_HEADING) liestat_heading(row[0], row);
  if (weighted) weight = number(values[rows->columns]);
  complain(context, liestat_state_add(memory->state, row, 1, 4, weighted ? &weight : NULL));
}
static void stepMoments(sqlite3_context* context, int n, sqlite3_value** values) { step(context, n, values, 0); }
static void stepSums(sqlite3_context* context, int n, sqlite3_value** values) { step(context, n, values, 1); }
static void stepMerge(sqlite3_context* context, int n, sqlite3_value** values) {
  Memory* memory = (Memory*)sqlite3_aggregate_context(context, sizeof *memory);
  Memory other;
  int code;
  (void)n;
  if (memory == NULL) return sqlite3_result_error_nomem(context);
  if (sqlite3_value_type(values[0]) == SQLITE_NULL) return;
  if ((code = readState(values[0], other.state)) != LIESTAT_STATE_OK) return complain(context, code);
  if (memory->state[0] == 0) {
    *memory = other;
  } else {
    complain(context, liestat_state_merge(memory->state, other.state));
  }
}

/* The state as a blob; NULL of no rows. */
static void finalState(sqlite3_context* context) {
  const Memory* memory = (const Memory*)sqlite3_aggregate_context(context, 0);
  if (memory == NULL || memory->state[0] == 0) return sqlite3_result_null(context);
  sqlite3_result_blob(context, memory->state, (int)liestat_state_kind_of(memory->state).size, SQLITE_TRANSIENT);
}

static char* addNumbers(char* at, const char* name, const double* numbers, int n) {
  int i;
  at += sprintf(at, "\"%s\":[", name);
  for (i = 0; i < n; ++i) {
    at += isfinite(numbers[i]) ? sprintf(at, "%s%.17g", i ? "," : "", numbers[i]) : sprintf(at, "%snull", i ? "," : "");
  }
  return at + sprintf(at, "],");
}
static double degreesOf(const double* row) {
  const double angle = atan2(row[1], row[0]) * (180 / 3.14159265358979323846);
  return angle < 0 ? angle + 360 : angle;
}
/* The mean of a state, as JSON. */
static void result(sqlite3_context* context, const void* state) {
  const int manifold = liestat_state_kind_of(state).manifold;
  liestat_mean mean;
  char text[2048], *at = text;
  const int code = liestat_state_finish(state, &mean);
  if (code != LIESTAT_STATE_OK) return complain(context, code);
  at += sprintf(at, "{");
  if (manifold == LIESTAT_HEADING && isfinite(mean.mean[0]))
    at += sprintf(at, "\"degrees\":%.17g,", degreesOf(mean.mean));
  at = addNumbers(at, "mean", mean.mean, manifold + 1);
  at = addNumbers(at, "covariance", mean.covariance, manifold * manifold);
  if (isfinite(mean.resultant)) at += sprintf(at, "\"resultant\":%.17g,", mean.resultant);
  if (isfinite(mean.step)) at += sprintf(at, "\"step\":%.17g,\"another_pass\":%d,", mean.step, mean.another_pass);
  sprintf(at, "\"n\":%llu,\"left_out\":%llu,\"status\":\"%s\",\"reason\":\"%s\"}", (unsigned long long)mean.n,
          (unsigned long long)mean.left_out, mean.status, mean.reason);
  sqlite3_result_text(context, text, -1, SQLITE_TRANSIENT);
}
static void finalMean(sqlite3_context* context) {
  const Rows* rows = (const Rows*)sqlite3_user_data(context);
  const Memory* memory = (const Memory*)sqlite3_aggregate_context(context, 0);
  liestat_mean mean;
  if (memory == NULL || memory->state[0] == 0) return sqlite3_result_null(context);
  if (rows->manifold != LIESTAT_HEADING) return result(context, memory->state);
  if (liestat_state_finish(memory->state, &mean) != LIESTAT_STATE_OK || !isfinite(mean.mean[0])) {
    return sqlite3_result_null(context);
  }
  sqlite3_result_double(context, degreesOf(mean.mean));
}
static void resultOf(sqlite3_context* context, int n, sqlite3_value** values) {
  uint64_t state[LIESTAT_STATE_LARGEST / 8];
  (void)n;
  if (sqlite3_value_type(values[0]) == SQLITE_NULL) return sqlite3_result_null(context);
  const int code = readState(values[0], state);
  if (code != LIESTAT_STATE_OK) return complain(context, code);
  result(context, state);
}

__attribute__((visibility("default"))) int sqlite3_liestat_init(sqlite3* db, char** error,
                                                                const sqlite3_api_routines* api) {
  const int flags = SQLITE_UTF8 | SQLITE_DETERMINISTIC | SQLITE_INNOCUOUS;
  int code = SQLITE_OK;
  size_t i;
  (void)error;
  SQLITE_EXTENSION_INIT2(api);
  for (i = 0; i < sizeof all_rows / sizeof *all_rows; ++i) {
    void* rows = (void*)&all_rows[i];
    int weighted;
    for (weighted = 0; weighted < 2; ++weighted) {
      const int n = all_rows[i].columns + weighted;
      char name[32];
      sprintf(name, "%s_mean", all_rows[i].name);
      code |= sqlite3_create_function(db, name, n, flags, rows, NULL, stepMoments, finalMean);
      sprintf(name, "%s_state", all_rows[i].name);
      code |= sqlite3_create_function(db, name, n, flags, rows, NULL, stepMoments, finalState);
      sprintf(name, "%s_sums", all_rows[i].name);
      code |= sqlite3_create_function(db, name, n + 1, flags, rows, NULL, stepSums, finalState);
    }
  }
  code |= sqlite3_create_function(db, "liestat_merge", 1, flags, NULL, NULL, stepMerge, finalState);
  code |= sqlite3_create_function(db, "liestat_result", 1, flags, NULL, resultOf, NULL, NULL);
  return code == SQLITE_OK ? SQLITE_OK : SQLITE_ERROR;
}
