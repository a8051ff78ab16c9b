// Planar targets in images, compiled once; see initialisation.cpp.
#ifndef LIESTAT_COMPILED_FUSION
#define LIESTAT_COMPILED_FUSION
#endif

#include <fusion/detail/levenberg_marquardt.hpp>
#include <fusion/targets/target_pose.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

namespace liestat {
namespace {

constexpr int lights = 6, largest_fit = 8 + 1 + lights;
/// The variance of a pixel's own aperture, px².
constexpr double pixel_variance = 1. / 12;
constexpr double first_blur = 0.6, largest_blur = 10;  // px
constexpr int max_steps = 30;
/// Cells at the rim that are not fitted: what lies beyond the pattern is not known, and is blurred into it.
constexpr double rim = 0.6;
/// Standard deviations of the blur beyond which a colour does not reach.
constexpr double reach = 4.5;
/// Pixels where nothing changes: they tell noise and light, and so many are enough.
constexpr std::size_t enough_flat = 4000;
/// The grey value's contrast, and its ratio to the noise, below which there is no pattern.
constexpr double least_contrast = 4, least_contrast_in_noise = 3;
/// Misfit that widens, in standard deviations of its law under noise, and its size that is another thing than a target.
constexpr double significant_misfit = 3, largest_misfit = 10;
constexpr int blocks = 8;
/// Width of a tag's cells, px, below which they are not resolved, and a fit ends beside the tag.
constexpr double least_cell = 0.8;

/// Black and white cells; those outside continue the nearest.
struct Cells {
  int columns = 0, rows = 0;
  std::vector<std::uint8_t> white;
  double operator()(int x, int y) const {
    return white[static_cast<std::size_t>(std::clamp(y, 0, rows - 1)) * static_cast<std::size_t>(columns) +
                 static_cast<std::size_t>(std::clamp(x, 0, columns - 1))];
  }
};

struct Sample {
  Eigen::Vector2d at;           // undistorted
  Eigen::Matrix2d at_by_pixel;  // its derivative by the pixel
  double grey = 0;
};

/// The pattern blurred by a Gaussian of covariance S (in cells), with gradient and ½ tr(S ∇²).
struct Blurred {
  double value = 0, spread = 0;
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
};

/// Weights of the cells along an axis under a Gaussian, with their first and second derivatives by its centre.
struct AlongAxis {
  static constexpr int most = 64;
  int first = 0, count = 0;
  std::array<double, most> weight, slope, bend;

  void take(double centre, double sigma) {
    first = static_cast<int>(std::floor(centre - reach * sigma));
    count = std::min(static_cast<int>(std::floor(centre + reach * sigma)) - first + 1, most);
    double below = 0, density_below = 0, z_below = 0;
    for (int k = 0; k < count; ++k) {
      const bool last = k + 1 == count;
      const double z = (first + k + 1 - centre) / sigma;
      const double part = last ? 1 : 0.5 * std::erfc(-z * 0.7071067811865476);
      const double density = last ? 0 : 0.3989422804014327 * std::exp(-0.5 * z * z);
      const auto i = static_cast<std::size_t>(k);
      weight[i] = part - below;
      slope[i] = (density_below - density) / sigma;
      bend[i] = (density_below * z_below - density * z) / (sigma * sigma);
      below = part, density_below = density, z_below = z;
    }
  }
};

Blurred blurred(const Cells& cells, const Eigen::Vector2d& c, const Eigen::Matrix2d& s) {
  Blurred result;
  const Eigen::Vector2d wide = s.diagonal().cwiseSqrt();
  const Eigen::Array2d low = (c - reach * wide).array().floor(), high = (c + reach * wide).array().floor();
  const double colour = cells(static_cast<int>(low.x()), static_cast<int>(low.y()));
  bool flat = true;
  for (int y = static_cast<int>(low.y()); flat && y <= static_cast<int>(high.y()); ++y) {
    for (int x = static_cast<int>(low.x()); flat && x <= static_cast<int>(high.x()); ++x) flat = cells(x, y) == colour;
  }
  if (flat) {
    result.value = colour;
    return result;
  }
  // S = diag(d²) + w wᵀ: exact along the axes, a sum of equal steps along w.
  const double rho = std::min(std::abs(s(0, 1)) / (wide.x() * wide.y()), 0.995);
  const double step = 1.5 * std::sqrt(1 - rho);
  const int nodes = rho < 0.01 ? 0 : static_cast<int>(std::ceil(reach / step));
  const Eigen::Vector2d d = wide * std::sqrt(1 - (nodes > 0 ? rho : 0));
  const Eigen::Vector2d w = std::sqrt(rho) * Eigen::Vector2d(wide.x(), s(0, 1) < 0 ? -wide.y() : wide.y());
  AlongAxis ax, ay;
  double total = 0;
  for (int n = -nodes; n <= nodes; ++n) {
    const double z = n * step, part = std::exp(-0.5 * z * z);
    total += part;
    ax.take(c.x() - z * w.x(), d.x());
    ay.take(c.y() - z * w.y(), d.y());
    for (int y = 0; y < ay.count; ++y) {
      const auto j = static_cast<std::size_t>(y);
      double value = 0, slope = 0, bend = 0;
      for (int x = 0; x < ax.count; ++x) {
        if (cells(ax.first + x, ay.first + y) == 0) continue;
        const auto i = static_cast<std::size_t>(x);
        value += ax.weight[i], slope += ax.slope[i], bend += ax.bend[i];
      }
      result.value += part * value * ay.weight[j];
      result.slope += part * Eigen::Vector2d(slope * ay.weight[j], value * ay.slope[j]);
      result.spread +=
          part * (0.5 * (s(0, 0) * bend * ay.weight[j] + s(1, 1) * value * ay.bend[j]) + s(0, 1) * slope * ay.slope[j]);
    }
  }
  result.value /= total, result.slope /= total, result.spread /= total;
  return result;
}

/// The fit of a pattern, as minimiseDamped wants it. Unknowns: the map (8, or 6 of an affine one) that follows G in
/// coordinates of −1 to 1 over the region, the logarithm of the blur, light.
class PatternFit {
 public:
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, largest_fit, 1>;
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, largest_fit, largest_fit>;

  /// `to_cells` takes undistorted coordinates to cells; the region lies round `middle`, `half` cells to all sides.
  PatternFit(Cells cells, const Eigen::Matrix3d& to_cells, const Eigen::Vector2d& middle, double half, int map)
      : cells_(std::move(cells)), middle_(middle), half_(half), map_(map), size_(map + 1 + lights) {
    Eigen::Matrix3d scale = Eigen::Matrix3d::Identity();
    scale.topLeftCorner<2, 2>() /= half;
    scale.block<2, 1>(0, 2) = -middle / half;
    now_.to_region = scale * to_cells;
    now_.light.setZero();
  }

  std::vector<Sample> samples;

  /// False where it does not converge, or the image does not look like the pattern.
  bool run() {
    if (samples.size() < 3 * static_cast<std::size_t>(size_)) return false;
    startLight();
    const detail::DampedSummary near = detail::minimiseDamped(*this, {.max_iterations = max_steps, .min_decrease = 1});
    if (near.status != FusionStatus::ok) return false;
    // To a thirtieth of a standard deviation. Sums are cut off where a colour's reach ends, and jump by less.
    const double variance = std::max(near.cost / static_cast<double>(samples.size()), pixel_variance);
    detail::minimiseDamped(*this, {.max_iterations = max_steps, .min_decrease = 1e-3 * variance});
    return finish();
  }
  double contrast() const { return now_.light[3]; }
  double noise() const { return noise_; }
  double blur() const { return std::sqrt(now_.blur * now_.blur + pixel_variance); }
  double misfit() const { return misfit_; }
  /// Undistorted coordinates of cells, and their derivative by the map.
  Eigen::Vector2d place(const Eigen::Vector2d& cell, Eigen::Matrix<double, 2, Eigen::Dynamic>& by_map) const {
    const Eigen::Vector2d region = (cell - middle_) / half_;
    Eigen::Vector2d at = (now_.to_region.inverse() * region.homogeneous()).hnormalized();
    const Eigen::Matrix2d back = derivative(at).inverse();
    by_map.resize(2, map_);
    for (int k = 0; k < map_; ++k) by_map.col(k) = -back * moved(region, k);
    return at;
  }
  /// The covariance of the map.
  Matrix covariance() const { return covariance_; }

  double linearise() {
    normal_.setZero(size_, size_);
    score_.setZero(size_);
    double cost = 0;
    for (const Sample& s : samples) {
      Vector row;
      const double r = residual(now_, s, &row);
      normal_.selfadjointView<Eigen::Lower>().rankUpdate(row);
      score_ += r * row;
      cost += r * r;
    }
    normal_.triangularView<Eigen::StrictlyUpper>() = normal_.transpose();
    return cost;
  }
  bool solve(double damping) {
    Matrix damped = normal_;
    damped.diagonal() *= 1 + damping;
    const Vector step = damped.ldlt().solve(score_);
    if (!step.allFinite()) return false;
    Eigen::Matrix3d map = Eigen::Matrix3d::Identity();
    for (int k = 0; k < map_; ++k) map(k / 3, k % 3) += step[k];
    next_.to_region = map * now_.to_region;
    next_.blur = now_.blur * std::exp(std::clamp(step[map_], -1., 1.));
    next_.light = now_.light + step.tail<lights>();
    return true;
  }
  double costAfterStep() const {
    if (!(next_.blur > 1e-3 && next_.blur < largest_blur)) return std::numeric_limits<double>::infinity();
    double cost = 0;
    for (const Sample& s : samples) {
      const double r = residual(next_, s, nullptr);
      cost += r * r;
    }
    return cost;
  }
  void accept() { now_ = next_; }
  void reject() {}

 private:
  struct State {
    Eigen::Matrix3d to_region = Eigen::Matrix3d::Identity();
    double blur = first_blur;
    Eigen::Matrix<double, lights, 1> light = Eigen::Matrix<double, 6, 1>::Zero();
  };

  /// ∂region/∂map(k): rows of the map one after the other.
  static Eigen::Vector2d moved(const Eigen::Vector2d& region, int k) {
    const double by = k % 3 == 2 ? 1 : region[k % 3];
    if (k < 3) return {by, 0};
    if (k < 6) return {0, by};
    return -by * region;
  }
  static Eigen::Matrix2d derivativeOf(const Eigen::Matrix3d& h, const Eigen::Vector2d& at) {
    const Eigen::Vector3d p = h * at.homogeneous();
    return (h.topLeftCorner<2, 2>() - p.hnormalized() * h.block<1, 2>(2, 0)) / p.z();
  }
  Eigen::Matrix2d derivative(const Eigen::Vector2d& at) const { return derivativeOf(now_.to_region, at); }

  double residual(const State& state, const Sample& s, Vector* row) const {
    const Eigen::Vector2d region = (state.to_region * s.at.homogeneous()).hnormalized();
    const Eigen::Matrix2d by_pixel = half_ * derivativeOf(state.to_region, s.at) * s.at_by_pixel;
    const double variance = state.blur * state.blur + pixel_variance;
    const Blurred p = blurred(cells_, middle_ + half_ * region, variance * by_pixel * by_pixel.transpose());
    const double contrast = state.light[3] + state.light.tail<2>().dot(region);
    const double value = state.light[0] + state.light.segment<2>(1).dot(region) + contrast * p.value;
    if (row != nullptr) {
      row->resize(size_);
      // Light moves with the region; its slopes are small beside those of the edges.
      const Eigen::Vector2d slope =
          contrast * half_ * p.slope + state.light.segment<2>(1) + p.value * state.light.tail<2>();
      for (int k = 0; k < map_; ++k) (*row)[k] = slope.dot(moved(region, k));
      (*row)[map_] = contrast * p.spread * 2 * state.blur * state.blur / variance;
      row->tail<lights>() << 1, region.x(), region.y(), p.value, p.value * region.x(), p.value * region.y();
    }
    return s.grey - value;
  }

  /// Light by linear least squares at the start.
  void startLight() {
    Eigen::Matrix<double, lights, lights> normal = Eigen::Matrix<double, 6, 6>::Identity();
    Eigen::Matrix<double, lights, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
    for (const Sample& s : samples) {
      Vector row;
      residual(now_, s, &row);
      normal += row.tail<lights>() * row.tail<lights>().transpose();
      right += s.grey * row.tail<lights>();
    }
    now_.light = normal.ldlt().solve(right);
  }

  /// Noise, misfit, covariance.
  bool finish() {
    const Matrix inverse = normal_.ldlt().solve(Matrix::Identity(size_, size_));
    if (!inverse.allFinite()) return false;
    const auto gain = inverse.topRows(map_);
    const Matrix of_map = inverse.topLeftCorner(map_, map_), weight = of_map.inverse();
    // The residuals by what they move the map.
    double square = 0, freedom = 0;
    std::array<Vector, blocks * blocks> moves;
    std::array<Matrix, blocks * blocks> parts;
    for (auto& m : moves) m.setZero(map_);
    for (auto& m : parts) m.setZero(map_, map_);
    for (const Sample& s : samples) {
      Vector row;
      const double r = residual(now_, s, &row);
      const Vector influence = gain * row;
      const double pull = influence.dot(weight * influence);
      square += pull * r * r;
      freedom += pull * (1 - std::min(row.dot(inverse * row), 1.));
      const Eigen::Vector2d region = (now_.to_region * s.at.homogeneous()).hnormalized();
      const Eigen::Array2i block = ((region.array() + 1) * blocks / 2).floor().cast<int>().max(0).min(blocks - 1);
      const auto b = static_cast<std::size_t>(block.y()) * blocks + static_cast<std::size_t>(block.x());
      moves[b] += r * influence;
      parts[b].noalias() += influence * influence.transpose();
    }
    const double variance = std::max(square / freedom, pixel_variance);
    noise_ = std::sqrt(variance);
    double together = 0, lost = 0;
    for (std::size_t b = 0; b < moves.size(); ++b) {
      together += moves[b].dot(weight * moves[b]);
      const Matrix share = weight * parts[b];
      lost += (share * share).trace();
    }
    const double expected = map_ - lost;
    if (!(expected > 0)) return false;
    misfit_ = together / (variance * expected);
    if (!(misfit_ > 1 + significant_misfit * std::sqrt(2 * lost) / expected)) misfit_ = 1;
    covariance_ = variance * misfit_ * of_map;
    return std::abs(contrast()) > std::max(least_contrast, least_contrast_in_noise * noise_) &&
           misfit_ < largest_misfit;
  }

  Cells cells_;
  Eigen::Vector2d middle_;
  double half_;
  int map_, size_;
  State now_, next_;
  Matrix normal_, covariance_;
  Vector score_;
  double noise_ = 0, misfit_ = 1;
};

/// Image coordinates without distortion, round a direction.
class Undistorted {
 public:
  Undistorted(const Camera& camera, const Eigen::Vector3d& ahead)
      : camera_(camera),
        turn_(Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), ahead).toRotationMatrix()) {}

  std::optional<Eigen::Vector2d> operator()(const Eigen::Vector2d& pixel) const {
    const auto bearing = camera_.bearing(pixel);
    if (!bearing) return std::nullopt;
    const Eigen::Vector3d p = turn_.transpose() * *bearing;
    if (!(p.z() > 0.02)) return std::nullopt;
    return Eigen::Vector2d(p.hnormalized());
  }
  std::optional<Eigen::Vector2d> pixel(const Eigen::Vector2d& at) const {
    return camera_.project(turn_ * at.homogeneous());
  }
  /// The derivative of the pixel.
  std::optional<Eigen::Matrix2d> pixelBy(const Eigen::Vector2d& at) const {
    constexpr double step = 1e-5;
    Eigen::Matrix2d slope;
    for (int k = 0; k < 2; ++k) {
      const Eigen::Vector2d d = step * Eigen::Vector2d::Unit(k);
      const auto after = pixel(at + d), before = pixel(at - d);
      if (!after || !before) return std::nullopt;
      slope.col(k) = (*after - *before) / (2 * step);
    }
    return slope;
  }

 private:
  const Camera& camera_;
  Eigen::Matrix3d turn_;
};

/// Adds the pixels that show a region of cells to a fit; false where it leaves the image.
bool addSamples(const GreyView& image, const Undistorted& undistorted, const Cells& cells,
                const Eigen::Matrix3d& to_cells, const Eigen::Vector2d& middle, double half, PatternFit& fit) {
  Eigen::Array2d low = Eigen::Array2d::Constant(1e9), high = -low;
  const Eigen::Matrix3d back = to_cells.inverse();
  for (int i = 0; i <= 16; ++i) {
    for (int side = 0; side < 4; ++side) {
      const double t = i / 8. - 1, s = side < 2 ? -1 : 1;
      const Eigen::Vector2d edge = side % 2 == 0 ? Eigen::Vector2d(t, s) : Eigen::Vector2d(s, t);
      const auto pixel = undistorted.pixel((back * (middle + half * edge).homogeneous()).hnormalized());
      if (!pixel) return false;
      low = low.min(pixel->array()), high = high.max(pixel->array());
    }
  }
  if (!(low.minCoeff() >= 0 && high.x() <= image.width - 1 && high.y() <= image.height - 1)) return false;
  std::vector<Sample> flat;
  for (int v = static_cast<int>(std::ceil(low.y())); v <= high.y(); ++v) {
    for (int u = static_cast<int>(std::ceil(low.x())); u <= high.x(); ++u) {
      const auto at = undistorted(Eigen::Vector2d(u, v));
      if (!at) continue;
      const Eigen::Vector2d cell = (to_cells * at->homogeneous()).hnormalized();
      if (!((cell - middle).cwiseAbs().maxCoeff() < half)) continue;
      const auto by = undistorted.pixelBy(*at);
      if (!by) continue;
      Sample sample{*at, by->inverse(), static_cast<double>(image.pixels[v * image.stride + u])};
      const Eigen::Vector3d p = to_cells * at->homogeneous();
      const Eigen::Matrix2d slope = (to_cells.topLeftCorner<2, 2>() - cell * to_cells.block<1, 2>(2, 0)) / p.z();
      // With room for the start's error and a blur that is not known yet.
      const Eigen::Matrix2d wide = 6 * slope * sample.at_by_pixel * (slope * sample.at_by_pixel).transpose();
      (blurred(cells, cell, wide).slope.isZero(0) ? flat : fit.samples).push_back(sample);
    }
  }
  const std::size_t every = flat.size() / enough_flat + 1;
  for (std::size_t i = 0; i < flat.size(); i += every) fit.samples.push_back(flat[i]);
  return true;
}

/// The pattern's cells, homography and points.
struct Placed {
  Cells cells;
  Eigen::Matrix3d to_cells;
  Eigen::Vector2d middle;
  double half = 0;
  int map = 8;
};

/// Fits a pattern and adds points (cells, and metres) to a view.
bool fitPoints(const GreyView& image, const Undistorted& undistorted, const Placed& placed,
               const std::vector<Eigen::Vector2d>& cells, std::vector<Eigen::Vector2d>& pixels,
               Eigen::MatrixXd& covariance, TargetPose& about, double& contrast) {
  PatternFit fit(placed.cells, placed.to_cells, placed.middle, placed.half, placed.map);
  if (!addSamples(image, undistorted, placed.cells, placed.to_cells, placed.middle, placed.half, fit) || !fit.run()) {
    return false;
  }
  const auto n = static_cast<Eigen::Index>(cells.size());
  Eigen::MatrixXd by_map(2 * n, placed.map);
  for (Eigen::Index i = 0; i < n; ++i) {
    Eigen::Matrix<double, 2, Eigen::Dynamic> by;
    const Eigen::Vector2d at = fit.place(cells[static_cast<std::size_t>(i)], by);
    const auto pixel = undistorted.pixel(at);
    const auto slope = undistorted.pixelBy(at);
    if (!pixel || !slope) return false;
    pixels.push_back(*pixel);
    by_map.middleRows<2>(2 * i) = *slope * by;
  }
  covariance = by_map * fit.covariance() * by_map.transpose();
  contrast = fit.contrast();
  about.noise = fit.noise(), about.blur = fit.blur();
  about.misfit = std::isnan(about.misfit) ? fit.misfit() : std::max(about.misfit, fit.misfit());
  return true;
}

/// Corners row by row, so that z points away from the camera.
void orderRows(std::vector<Eigen::Vector2d>& pixels, int columns) {
  const Eigen::Vector2d x = pixels[static_cast<std::size_t>(columns) - 1] - pixels[0];
  const Eigen::Vector2d y = pixels[pixels.size() - static_cast<std::size_t>(columns)] - pixels[0];
  if (x.x() * y.y() - x.y() * y.x() > 0) return;
  for (auto row = pixels.begin(); row != pixels.end(); row += columns) std::reverse(row, row + columns);
}

TargetView fitChessboard(const GreyView& image, const Undistorted& undistorted, const Target& target,
                         std::vector<Eigen::Vector2d> seen) {
  orderRows(seen, target.columns);
  TargetView result;
  for (int turn = 0; turn < 2; ++turn) {
    result = {};
    std::vector<Eigen::Vector2d> places, squares;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const auto at = undistorted(seen[i]);
      if (!at) return {};
      places.push_back(*at);
      squares.emplace_back(static_cast<int>(i) % target.columns, static_cast<int>(i) / target.columns);
    }
    const auto to_squares = fitHomography(places, squares);
    if (!to_squares) return {};
    int inverted = 0;
    double squares_of_sigma = 0, squares_of_noise = 0, squares_of_blur = 0;
    std::vector<Eigen::Matrix2d> covariances;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      Placed placed;
      placed.cells = {4, 4, {}};
      const int parity = static_cast<int>(squares[i].sum()) % 2;
      for (int c = 0; c < 16; ++c)
        placed.cells.white.push_back(static_cast<std::uint8_t>((c % 4 + c / 4 + parity) % 2));
      Eigen::Matrix3d shift = Eigen::Matrix3d::Identity();
      shift.block<2, 1>(0, 2) = Eigen::Vector2d(2, 2) - (*to_squares * places[i].homogeneous()).hnormalized();
      placed.to_cells = shift * *to_squares;
      placed.middle = {2, 2}, placed.half = 0.5, placed.map = 6;
      Eigen::MatrixXd covariance;
      double contrast = 0;
      if (!fitPoints(image, undistorted, placed, {Eigen::Vector2d(2, 2)}, result.view.pixels, covariance, result.about,
                     contrast)) {
        ++result.about.not_fitted;
        continue;
      }
      inverted += contrast < 0 ? 1 : -1;
      squares_of_sigma += covariance.trace() / 2;
      squares_of_noise += result.about.noise * result.about.noise;
      squares_of_blur += result.about.blur * result.about.blur;
      covariances.emplace_back(covariance);
      result.view.points.push_back(target.size * squares[i]);
    }
    if (result.view.points.empty()) return {};
    result.about.points = result.view.points.size();
    const auto fitted = static_cast<double>(covariances.size());
    result.about.sigma = std::sqrt(squares_of_sigma / fitted);
    result.about.noise = std::sqrt(squares_of_noise / fitted);
    result.about.blur = std::sqrt(squares_of_blur / fitted);
    result.view.covariance.resize(2 * static_cast<Eigen::Index>(covariances.size()), 2);
    for (std::size_t i = 0; i < covariances.size(); ++i) {
      result.view.covariance.middleRows<2>(2 * static_cast<Eigen::Index>(i)) = covariances[i];
    }
    if (inverted < 0) return result;
    std::reverse(seen.begin(), seen.end());
  }
  return {};
}

TargetView fitTag(const GreyView& image, const Undistorted& undistorted, const Target& target, const SeenTarget& seen) {
  TargetView result;
  const double outside = (seen.side - seen.border) / 2., inside = seen.side - outside;
  const std::vector<Eigen::Vector2d> corners = {
      {outside, outside}, {inside, outside}, {inside, inside}, {outside, inside}};
  std::vector<Eigen::Vector2d> places;
  for (const Eigen::Vector2d& pixel : seen.pixels) {
    const auto at = undistorted(pixel);
    if (!at) return {};
    places.push_back(*at);
  }
  const auto to_cells = fitHomography(places, corners);
  if (!to_cells) return {};
  const double half = seen.side / 2.;
  const Eigen::Matrix3d back = to_cells->inverse();
  const Eigen::Vector3d centre = back * Eigen::Vector3d(half, half, 1);
  const auto slope = undistorted.pixelBy(centre.hnormalized());
  if (!slope) return {};
  const Eigen::Matrix2d cell =
      *slope * (back.topLeftCorner<2, 2>() - centre.hnormalized() * back.block<1, 2>(2, 0)) / centre.z();
  const double square = cell.squaredNorm() / 2, area = cell.determinant();
  const double narrow = std::sqrt(std::max(square - std::sqrt(std::max(square * square - area * area, 0.)), 0.));
  if (!(narrow >= least_cell)) return {};
  const Placed placed{{seen.side, seen.side, seen.cells}, *to_cells, {half, half}, half - rim, 8};
  double contrast = 0;
  if (!fitPoints(image, undistorted, placed, corners, result.view.pixels, result.view.covariance, result.about,
                 contrast) ||
      !(contrast > 0)) {
    return {};
  }
  for (const Eigen::Vector2d& c : corners) {
    result.view.points.push_back(target.size / seen.border * (c - Eigen::Vector2d(half, half)));
  }
  result.about.points = corners.size();
  result.about.sigma = std::sqrt(result.view.covariance.trace() / 8);
  return result;
}

}  // namespace

TargetView fitTarget(const GreyView& image, const Camera& camera, const Target& target, const SeenTarget& seen) {
  TargetView result;
  Eigen::Vector3d ahead = Eigen::Vector3d::Zero();
  for (const Eigen::Vector2d& pixel : seen.pixels) {
    if (const auto bearing = camera.bearing(pixel)) ahead += *bearing;
  }
  if (seen.pixels.size() >= 4 && ahead.norm() > 0) {
    const Undistorted undistorted(camera, ahead);
    result = target.kind == Target::Kind::april ? fitTag(image, undistorted, target, seen)
                                                : fitChessboard(image, undistorted, target, seen.pixels);
  }
  result.about.id = seen.id;
  return result;
}

TargetPose estimateTargetPose(const GreyView& image, const Camera& camera, const Target& target,
                              const SeenTarget& seen) {
  TargetView found = fitTarget(image, camera, target, seen);
  found.about.result = estimatePlanarPose(found.view, camera);
  return found.about;
}

}  // namespace liestat
