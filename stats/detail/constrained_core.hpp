// The core of constrained estimation, which is no template: sizes are run-time numbers, and everything is plain loops in
// double over rows of numbers. The front, stats/constrained.hpp, describes the problem by records of functions. As a
// template the same iteration took a compiler nine seconds for each combination of parameter, constraint and channels.
//
// Matrices are row-major. Memory is allocated when the problem is set up, and never for a measurement.
#pragma once

#include <stats/constrained_types.hpp>
#include <stats/detail/compiled.hpp>
#include <stats/measurement_noise.hpp>

#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace liestat::detail {

/// A matrix of run-time size in row-major order, zero at first.
class Rows {
 public:
  Rows() = default;
  Rows(int rows, int cols)
      : rows_(rows), cols_(cols), values_(static_cast<std::size_t>(rows) * static_cast<std::size_t>(cols)) {}
  int rows() const { return rows_; }
  int cols() const { return cols_; }
  double* operator[](int i) { return values_.data() + i * cols_; }
  const double* operator[](int i) const { return values_.data() + i * cols_; }
  double* data() { return values_.data(); }
  const double* data() const { return values_.data(); }
  void setZero() { values_.assign(values_.size(), 0); }

 private:
  int rows_ = 0, cols_ = 0;
  std::vector<double> values_;
};
using Numbers = std::vector<double>;

/// The points of the parameter's manifold that the front keeps.
enum class ParameterPoint { current, trial, shifted };

/// The parameter, its constraints and its prior; `problem` is the front's.
struct ParameterFunctions {
  int dimension, constraints;
  bool is_vector;  ///< exp and log are sums and differences
  bool linear;     ///< the constraints' derivative is the same everywhere
  /// exp(from, step) becomes the point `to`; no step is none.
  void (*move)(void* problem, ParameterPoint from, ParameterPoint to, const double* step);
  const void* (*point)(const void* problem, ParameterPoint point);
  /// The coordinates of a vector.
  void (*coordinates)(const void* problem, double* values);
  /// The derivative by a step at the shifted point times this matrix is the one by the coordinates at the current one.
  void (*transport)(const void* problem, double* matrix);
  void (*constraint)(const void* problem, ParameterPoint point, double* values);
  void (*linearizeConstraint)(const void* problem, ParameterPoint point, double* values, double* by_parameter);
  /// log(mean, point) of the prior, and its derivative by the point unless that is null.
  void (*priorError)(const void* problem, ParameterPoint point, double* error, double* by_parameter);
};

/// The equations of the measurements of one kind. Both functions take `count` measurements from `first` on, with their
/// corrections one after the other; `q` is what ParameterFunctions::point returned.
struct ChannelFunctions {
  int equations, rank, dimension;
  bool is_vector;
  void (*linearize)(const void* channel, const void* q, std::size_t first, std::size_t count, const double* at,
                    double* values, double* by_parameter, double* by_measurement);
  void (*evaluate)(const void* channel, const void* q, std::size_t first, std::size_t count, const double* at,
                   double* values);
};

struct NoiseRows;

/// The noises of a channel, one or one for each measurement: a variance, variances, or matrices.
struct NoiseTable {
  NoiseForm form = NoiseForm::isotropic;
  int dimension = 0;
  bool one = true;                       ///< one for all measurements
  Numbers covariance, information;       ///< each noise's, 1, K or K² numbers
  bool can_be_free = false;              ///< the information may be singular
  std::vector<int> null_dimension = {};  ///< where it can be: of each noise,
  Numbers null_basis = {};               ///< with a basis in the first columns of K×K

  std::size_t index(std::size_t i) const { return one ? 0 : i; }
  std::size_t stride() const;
  /// eᵀ Q e.
  double squaredNorm(std::size_t i, const double* e) const;
  NoiseRows rows(std::size_t i) const;
  /// V or Q as a matrix.
  void matrix(const Numbers& list, std::size_t i, double* result) const;
  /// The projection V Q on the directions that are not exact; false where none is, and nothing to project.
  bool movingDirections(std::size_t i, const double* Q, double* projection, double* work) const;
  /// A standard deviation of the coordinates.
  double typicalDeviation(std::size_t i) const;
};

struct ChannelRecord {
  const ChannelFunctions* functions = nullptr;
  const void* channel = nullptr;
  std::size_t size = 0;
  NoiseTable noise = {};
  Numbers coordinates = {};  ///< those of vectors that were observed
  Numbers start = {};        ///< corrections with which the iteration starts
};

struct ConstrainedSettings {
  int max_iterations = 100;
  double tolerance = 1e-9;
  bool curvature = true, second_order = true;
  StatedNoise noise = StatedNoise::tested;
  Numbers prior_information = {};  ///< empty without a prior
  int prior_rank = 0;
};

/// The members of ConstrainedResult that depend on no type.
struct ConstrainedOutcome {
  ConstrainedEnd end = ConstrainedEnd::running;
  double chi2 = std::numeric_limits<double>::quiet_NaN(), equation_error = chi2, fit_p = chi2;
  int degrees_of_freedom = 0, free_parameters = 0, equations = 0, dropped_equations = 0, constraints = 0,
      dropped_constraints = 0, iterations = 0, unobservable = 0, active_bounds = 0;
  std::size_t uninformative = 0;
  bool used_curvature = false, minimum_checked = false;
  RelativeCurvature relative_curvature = {};
  double widening = 1;
  Rows information = {}, covariance = {}, unobservable_basis = {}, determined_covariance = {};
};

/// The null space and solution of linear equations C δ = d in N unknowns. Singular values of C with unit rows that are
/// below 5e-8 count as zero, so the scale of an equation does not matter; redundant ones are met in least squares.
class ConstraintBasis {
 public:
  /// No equations.
  ConstraintBasis(int unknowns, int equations);
  void compute(const Rows& C);

  int rank() const { return rank_; }
  /// Rows: an orthonormal basis of what is free, N - rank() of them.
  const Rows& freeBasis() const { return Z_; }
  /// The shortest solution of C δ = factor d.
  void shortest(const Numbers& d, double factor, Numbers& step) const;
  double shortestLength(const Numbers& d) const;
  /// The length of the part of g that the equations fix.
  double fixedLength(const Numbers& g) const;
  /// The shortest λ with Cᵀ λ = -g on that part.
  void multipliers(const Numbers& g, Numbers& lambda) const;
  /// The largest |c_k| over the length of its gradient, those left out included; where there is no gradient, |c_k|:
  /// nothing will ever meet that equation.
  double largest(const Numbers& c) const;

 private:
  double along(int k, const Numbers& g) const;
  double fixedCoordinate(int k, const Numbers& d) const;

  int n_, p_, rank_ = 0;
  Rows Z_, Y_, U_;
  Numbers values_, scale_;
};

/// The minimum of ½ δᵀ A δ - bᵀ δ along the directions that are free. Where A does not determine δ, it stays at zero.
class TangentSystem {
 public:
  explicit TangentSystem(int n) : A_(n, n), axes_(n, n), values_(static_cast<std::size_t>(n)) {}
  /// `basis`: orthonormal rows, `free` of them. A may be the Hessian of a Lagrangian: eigenvalues count by their size,
  /// where `indefinite` no less than a millionth of the largest.
  void compute(const Rows& A, const Rows& basis, int free, bool indefinite = false);

  /// δ, from its part that the constraints fix.
  void solve(const Numbers& b, Numbers& step) const;
  /// The number of directions that A leaves open, and an orthonormal basis of them, rows.
  int nullDimension() const { return null_dimension_; }
  Rows nullBasis() const;
  /// Rows d_k with d_kᵀ A d_l = δ_kl: a basis of the directions that A determines, one standard deviation long.
  Rows determinedBasis() const;
  /// Z (Zᵀ A Z)⁻¹ Zᵀ over these directions.
  Rows covariance() const;

 private:
  Rows A_, axes_;
  Numbers values_;
  int free_ = 0, null_dimension_ = 0;
};

/// Second derivatives of the equations along directions d_a of the parameter, one standard deviation long, in units of
/// the noise: sums over the measurements (docs/theory/constrained.md, section 6).
struct CurvatureSums {
  CurvatureSums(Rows directions_, Rows bends_)
      : directions(std::move(directions_)),
        bends(std::move(bends_)),
        tangent(directions.rows() * directions.rows(), directions.rows()),
        spread(directions.rows(), directions.rows()),
        bias(static_cast<std::size_t>(directions.rows())) {}

  Rows directions, bends;  ///< d_a; the constraints' second-order steps w_ab for b ≤ a, one after the other
  Rows tangent;            ///< row ab, column c: Σ a_ab·v_c, what of the curvature lies along the model
  Rows spread;             ///< the part of the information that is noise of the corrected measurements along the model
  Numbers bias;            ///< -½ Σ v·tr a, the second-order bias
  double total = 0;        ///< Σ 2 ‖a‖² + ‖tr a‖², tangent and normal
  bool known = true;       ///< false where a measurement has free directions
};

/// Criterion and equations at some point.
struct ChannelMerit {
  double cost = 0;       ///< Σ ‖ε‖²_Q
  double violation = 0;  ///< Σ ‖c‖ in units of the noise
  double squared_violation = 0;
};

/// The measurements of one kind: their corrections, their linearised equations, their sums. With ε the correction of a
/// measurement in the tangent space at what was observed and δ the step of the parameter, its equations are
/// value + C δ + D (ε − ε₀) = 0. Whitened by the root L of S = D V Dᵀ they become Ĉ δ + λ̂ = r̂, where ε = G λ̂ is the
/// shortest correction and ‖λ̂‖² its squared length (docs/theory/constrained.md, section 4).
class ConstrainedChannel {
 public:
  ConstrainedChannel(ChannelRecord record, int parameters);

  std::size_t size() const { return n_; }
  /// The front's channel.
  const void* observed() const { return record_.channel; }
  /// Linearises at q and at the corrections; adds to the upper triangle of A, and to b. False if something is not
  /// finite.
  bool linearize(const void* q, Rows& A, Numbers& b);
  /// The same with the curvature of the equations, after linearize(); adds to all of A.
  void linearizeCurved(const ParameterFunctions& parameter, void* problem, double step, Rows& A, Numbers& b,
                       CurvatureSums* sums = nullptr);
  /// Measurements whose correction is no minimum for the parameter, in linearizeCurved().
  std::size_t misplaced() const { return misplaced_; }
  /// Corrections for a step; returns the largest multiplier in units of the noise.
  double step(const Numbers& delta, bool curved);
  /// ‖Δε‖² of the step, in units of the noise, and ε·Q Δε.
  void stepLengths(double& squared, double& slope) const;
  /// The squared length of one rounding error in each coordinate, in units of the noise.
  double roundingSquared() const { return rounding_; }
  /// The length of the step along free directions.
  double freeStep() const;
  /// Criterion and equations where the iteration stands, and where a step of a part `alpha` leads.
  void addMerit(ChannelMerit& sum) const;
  void tryStep(const void* q, double alpha, ChannelMerit& sum);
  /// Sums of the second-order correction: the step that takes the equations at the trial point to zero.
  void addCorrectionSums(Numbers& b) const;
  double correctionSquared(const Numbers& delta) const;
  void tryCorrected(const void* q, const Numbers& delta, ChannelMerit& sum);
  void accept() { at_.swap(trial_); }
  void acceptFull() { at_ = next_; }

  int keptEquations() const;
  int droppedEquations() const;
  /// Those among them that do not hold, because the coordinates that they depend on are exact.
  int unmetEquations(const void* q);
  std::size_t uninformative() const;

  const double* correction(std::size_t i) const { return at_.data() + i * static_cast<std::size_t>(K); }
  int equationsOf(std::size_t i) const { return ranks_[i]; }
  /// V - G Gᵀ + (G Ĉ) Λ (G Ĉ)ᵀ.
  void covarianceOf(std::size_t i, const Rows& parameter, double* result) const;
  /// p_i - tr(Ĉ Λ Ĉᵀ).
  double expectedSquare(std::size_t i, const Rows& parameter) const;

 private:
  double* block(Numbers& list, std::size_t i, int size) const;
  const double* block(const Numbers& list, std::size_t i, int size) const;
  int freeOf(std::size_t i) const;
  bool build(std::size_t i, const double* values, const double* by_parameter, const double* by_measurement);
  int selected(std::size_t i) const;
  void halfSolve(std::size_t i, const double* B, int cols, double* X) const;
  void whitened(std::size_t i, const double* values, double* result) const;
  void recover(std::size_t i, double* correction, const double* observed, double sign, const Numbers& delta) const;
  void correctionOf(std::size_t i, const Numbers& delta, double* correction) const;
  void add(std::size_t i, const double* correction, const double* whitened, ChannelMerit& sum) const;
  void evaluate(const void* q, ChannelMerit& sum);
  void lagrange(std::size_t i, double* lambda) const;
  void addCurved(std::size_t i, double* H, Rows& A, Numbers& b);
  void addCurvature(std::size_t i, const double* second, CurvatureSums& sums) const;

  ChannelRecord record_;
  int N, P, K;
  std::size_t n_;
  double rounding_ = 0;
  Numbers at_, next_, trial_, values_, multipliers_;
  Numbers C_, D_, r_, value_, G_, root_;  // Ĉ, L⁻¹ D, r̂, L⁻¹ value, Gᵀ, rows of L that were kept, inverse pivots
  std::vector<int> ranks_, order_;
  // Where the information is singular: directions N_i of the measurement are free. Zᵀ D N_i = 0 selects the equations
  // that do not depend on them; `recovery` is N_i (D N_i)⁺. C, D and r as they were before.
  Numbers selection_, recovery_, free_C_, free_D_, free_r_;
  // The same with the curvature of the equations: the correction is base + slope δ.
  Numbers base_, slope_;
  std::vector<char> curved_;
  std::size_t misplaced_ = 0;
  Numbers raw_values_, raw_C_, raw_D_, difference_steps_;
  mutable Numbers scratch_;
};

/// The iteration. `problem` is the front's, the same at each call but for its address.
class ConstrainedCore {
 public:
  LIESTAT_ESTIMATION_API ConstrainedCore(const ParameterFunctions& parameter, std::vector<ChannelRecord> channels,
                                         ConstrainedSettings settings, bool valid);

  /// One step; true while there is more to do.
  bool iterate(void* problem);
  /// Ends the iteration at what has been reached.
  void stop(void* problem);
  const ConstrainedOutcome& result() const { return result_; }
  const ConstrainedChannel& channel(std::size_t k) const { return channels_[k]; }

 private:
  struct Merit {
    double cost = 0, violation = 0, squared_violation = 0, constraint = 0;
  };

  bool hasPrior() const { return !settings_.prior_information.empty(); }
  const void* point(const void* problem, ParameterPoint which) const { return parameter_.point(problem, which); }
  void linearize(void* problem);
  bool linearizeCurved(void* problem, CurvatureSums* sums = nullptr);
  CurvatureSums curvatureSums(void* problem);
  void setCurvature(const CurvatureSums& sums);
  std::vector<Rows> constraintCurvatures(void* problem, double h);
  double differenceStep(const void* problem) const;
  Merit meritOf(const ChannelMerit& sum, double prior_cost, const Numbers& constraints) const;
  Merit meritAt(const void* problem, ParameterPoint which, const ChannelMerit& sum);
  double phi(const Merit& merit) const;
  double weighed(const Numbers& e) const;
  double parameterSize(const void* problem) const;
  double rounding(const void* problem) const;
  bool step(void* problem, bool curved);
  bool search(void* problem, const Merit& here, double slope, double length, double parameter_step, bool met);
  bool restore(void* problem, const Merit& here);
  bool accept(void* problem);
  bool settle(void* problem);
  bool leaveSaddle(void* problem, const Numbers& direction, double curvature, ConstrainedEnd otherwise);
  void setCovariance();
  bool isRefuted();
  double noiseScale() const;
  bool finish(void* problem, ConstrainedEnd end);
  double equationError(void* problem);

  ParameterFunctions parameter_;
  ConstrainedSettings settings_;
  std::vector<ConstrainedChannel> channels_;
  ConstrainedOutcome result_;
  int N, P;
  std::size_t measurements_ = 0;
  Rows A_, curved_A_, C_, prior_J_;
  Numbers b_, curved_b_, prior_slope_, delta_, gradient_, error_, further_;
  ConstraintBasis basis_;
  TangentSystem system_, curved_system_;
  Numbers constraint_values_, trial_values_, constraint_multipliers_;
  bool have_basis_ = false, finite_ = true, settled_ = false, cut_ = false;  // cut: the last step was
  double prior_cost_ = 0, penalty_ = 0, constraint_penalty_ = 0, last_length_ = 0, free_step_ = 0;
  int slow_steps_ = 0, left_saddles_ = 0, restorations_ = 0;
  /// Second derivatives at the end: the null directions of A that they determine, rows, those that stay open, and the
  /// directions in which the parameter moves off active bounds.
  Rows bound_, open_, off_bounds_;
};

}  // namespace liestat::detail

#ifdef LIESTAT_HEADER_ONLY
#include <stats/detail/constrained_iteration.hpp>
#endif
