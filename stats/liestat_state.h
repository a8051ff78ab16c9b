/* liestat_state.h: means that merge, for engines that aggregate rows (SQL, MPI, Dask). C ABI of stats/state.hpp; link
 * liestat_means and the C++ runtime. docs/states.md has the bytes and the passes.
 *
 * A state is plain old data of liestat_state_size() bytes, aligned to 8, that may be copied, stored and sent as it
 * stands (little-endian). Its bytes depend on the rows alone, not on their order, how they were divided, or the
 * processor. No function allocates or throws.
 */
#ifndef LIESTAT_STATE_H
#define LIESTAT_STATE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Manifolds, and a row of each: headings (cos, sin), directions (x, y, z), rotations (quaternions x, y, z, w). */
enum { LIESTAT_HEADING = 1, LIESTAT_DIRECTION = 2, LIESTAT_ROTATION = 3 };
/* Kinds: moments, whose result is the chordal mean, and sums at a reference, for the Frechet mean. */
enum { LIESTAT_MOMENTS = 1, LIESTAT_SUMS = 2 };

/* Results of functions: LIESTAT_STATE_OK, or why nothing was done. */
enum {
  LIESTAT_STATE_OK = 0,
  LIESTAT_STATE_BAD_ARGUMENT,  /* no such manifold or kind, or a reference that is not of unit norm */
  LIESTAT_STATE_BAD_WEIGHT,    /* a weight is not finite, negative, or above the scale of the state */
  LIESTAT_STATE_TOO_MANY,      /* more than 2^33 rows */
  LIESTAT_STATE_DIFFERENT,     /* of another manifold, kind, reference, scale or pass */
  LIESTAT_STATE_FOREIGN,       /* not the bytes of a state, or of another size */
  LIESTAT_STATE_NEWER_VERSION, /* of a version that this library does not know */
  LIESTAT_STATE_FORGED         /* numbers that no rows have */
};
/* The same in a sentence. */
const char* liestat_state_error(int code);

#define LIESTAT_STATE_LARGEST 456 /* bytes of the largest state */

/* The kind of a state, made or read by these functions. */
typedef struct liestat_state_kind {
  int manifold, kind;
  int weight_exponent, pass; /* pass: of sums, from 1; 0 of moments */
  size_t size;               /* bytes */
} liestat_state_kind;
liestat_state_kind liestat_state_kind_of(const void* state);

/* Bytes of a state; 0 if there is no such one. */
size_t liestat_state_size(int manifold, int kind);
/* An empty state. Sums: at a reference, a row, in the given pass (1 for the first). Weights are at most
 * 2^weight_exponent, which is within -1000 and 1000. */
int liestat_state_init(void* state, int manifold, int kind, const double* reference, int weight_exponent, int pass);
/* Adds rows, `stride` numbers from one to the next, with weights unless NULL. Rows that are not finite or whose norm is
 * off by more than 1e-3 are counted and left out; others are normalised. Rows of weight zero do not count. A bad weight:
 * nothing is added. */
int liestat_state_add(void* state, const double* rows, size_t n, size_t stride, const double* weights);
/* Adds what `other`, a state made by these functions, has seen. */
int liestat_state_merge(void* state, const void* other);
/* Checks bytes from elsewhere and copies them into a state that has room for LIESTAT_STATE_LARGEST. */
int liestat_state_read(void* state, const void* bytes, size_t size);
/* The row of a heading in degrees; NaN of one that is not finite. The same bits everywhere. */
void liestat_heading(double degrees, double row[2]);

/* A finished mean. */
typedef struct liestat_mean {
  double mean[4];       /* a row; NaN of nothing, and of vectors that cancel */
  double covariance[9]; /* DoF x DoF, rad^2; NaN unless status is ok */
  double resultant; /* moments: length of the mean row (rotations: root of the largest eigenvalue), 0 to 1; else NaN */
  double step;      /* sums: rad from the reference to the mean; else NaN */
  uint64_t n, left_out; /* rows that count, and bad ones */
  int another_pass;     /* sums: 1 if sums at `mean` are needed to finish */
  const char* status;   /* ok, or the word of a liestat::Status */
  const char* reason;   /* in words, where status is not ok */
} liestat_mean;
int liestat_state_finish(const void* state, liestat_mean* result);

#ifdef __cplusplus
}
#endif
#endif
