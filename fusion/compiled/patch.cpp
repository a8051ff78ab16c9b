#include <fusion/tracking/patch.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>

namespace liestat {
namespace {

constexpr int side = Patch::side, half = Patch::half;
/// A smoothed pixel's share of white noise's variance, and that of a central difference of smoothed pixels.
constexpr double smooth_share = 36. / 256, slope_share = 10. / 64 * 6 / 16;
/// Correlation of neighbouring smoothed pixels, along u or v.
constexpr double neighbour_correlation = 4. / 6;
/// Standard deviation of an affine's element from one image to the next.
constexpr double affine_step = 0.03;
/// Mean square of the weaker gradient of a template, below which it is no corner, (grey values per px)².
constexpr double least_slope = 1;
/// Noise that is assumed before there is a residual, grey values squared.
constexpr double first_variance = 16;
constexpr int max_iterations = 15;
constexpr double converged = 0.004, farthest = 3;  // px
/// Singular values of an affine outside of these: the template has lost its scale.
constexpr double least_scale = 0.6, largest_scale = 1.67;
constexpr double largest_sigma = 1;  // px
/// Misfit in standard deviations of its law under noise: widens the covariance; and its size that ends a track.
constexpr double significant_misfit = 2, largest_misfit = 4, largest_mean_misfit = 1.6;
constexpr double misfit_memory = 8;  // images
/// A residual's variance over that of the track so far: how much of it may be noise, and what is another thing.
constexpr double largest_surprise = 1.25, largest_rise = 4;

/// Columns of fields of 21 × 21, smoothed as images are: fields of 23 × 23.
template <class Fields>
Eigen::MatrixXf smoothed(const Fields& fields) {
  constexpr int wide = side + 2;
  Eigen::MatrixXf result = Eigen::MatrixXf::Zero(wide * wide, fields.cols());
  const float weights[] = {0.25f, 0.5f, 0.25f};
  for (int dv = 0; dv < 3; ++dv) {
    for (int du = 0; du < 3; ++du) {
      const float w = weights[dv] * weights[du];
      for (int v = 0; v < side; ++v) {
        result.middleRows((v + dv) * wide + du, side) += w * fields.middleRows(v * side, side);
      }
    }
  }
  return result;
}

using Sampled = Eigen::Matrix<float, Patch::pixels, 1>;

/// The image at p + A x for the patch's x, bilinear; false where a pixel lies outside.
bool sample(const SmoothImage& image, const Eigen::Vector2d& p, const Eigen::Matrix2d& a, Sampled& out) {
  const Eigen::Vector2d reach = half * a.cwiseAbs().rowwise().sum();
  if (!((p - reach).minCoeff() >= 0 && p.x() + reach.x() < image.width() - 1 &&
        p.y() + reach.y() < image.height() - 1)) {
    return false;
  }
  const Eigen::Vector2i whole = (p - reach).array().floor().cast<int>();
  const Eigen::Vector2f rest = (p - whole.cast<double>()).cast<float>();
  const Eigen::Matrix2f m = a.cast<float>();
  const std::ptrdiff_t stride = image.width();
  const float* const base = image.row(whole.y()) + whole.x();
  float* value = out.data();
  for (int y = -half; y <= half; ++y) {
    const float u0 = rest.x() + m(0, 1) * static_cast<float>(y), v0 = rest.y() + m(1, 1) * static_cast<float>(y);
    for (int x = -half; x <= half; ++x) {
      // Rounding can take a pixel of the border below zero.
      const float u = std::max(u0 + m(0, 0) * static_cast<float>(x), 0.f);
      const float v = std::max(v0 + m(1, 0) * static_cast<float>(x), 0.f);
      const int iu = static_cast<int>(u), iv = static_cast<int>(v);
      const float fu = u - static_cast<float>(iu), fv = v - static_cast<float>(iv);
      const float* const at = base + iv * stride + iu;
      const float above = at[0] + fu * (at[1] - at[0]), below = at[stride] + fu * (at[stride + 1] - at[stride]);
      *value++ = above + fv * (below - above);
    }
  }
  return true;
}

/// The part of a variance that bilinear interpolation leaves, over the patch, by the correlation of neighbours.
double interpolated(const PatchMatch& match, double correlation) {
  double sum = 0;
  for (int y = -half; y <= half; y += half / 2) {
    for (int x = -half; x <= half; x += half / 2) {
      const Eigen::Vector2d at = match.at + match.affine * Eigen::Vector2d(x, y);
      const Eigen::Array2d f = at.array() - at.array().floor();
      sum += (1 - 2 * (1 - correlation) * f * (1 - f)).prod();
    }
  }
  return sum / 25;
}

}  // namespace

void SmoothImage::take(const GreyView& image) {
  width_ = image.width, height_ = image.height;
  columns_.resize(static_cast<std::size_t>(width_) + 2);
  pixels_.resize(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
  for (int v = 0; v < height_; ++v) {
    const std::uint8_t* const middle = image.pixels + v * image.stride;
    const std::uint8_t* const above = v > 0 ? middle - image.stride : middle;
    const std::uint8_t* const below = v + 1 < height_ ? middle + image.stride : middle;
    std::uint16_t* const sums = columns_.data() + 1;
    for (int u = 0; u < width_; ++u) sums[u] = static_cast<std::uint16_t>(above[u] + 2 * middle[u] + below[u]);
    sums[-1] = sums[0];
    sums[width_] = sums[width_ - 1];
    float* const out = pixels_.data() + static_cast<std::size_t>(v) * static_cast<std::size_t>(width_);
    for (int u = 0; u < width_; ++u) {
      out[u] = static_cast<float>(sums[u - 1] + 2 * sums[u] + sums[u + 1]) * (1.f / 16);
    }
  }
}

std::optional<Patch> Patch::at(const SmoothImage& image, const Eigen::Vector2i& pixel) {
  if (pixel.minCoeff() < margin || pixel.x() >= image.width() - margin || pixel.y() >= image.height() - margin) {
    return std::nullopt;
  }
  Patch patch;
  patch.pixel_ = pixel;
  Design& j = patch.design_;
  int row = 0;
  for (int y = -half; y <= half; ++y) {
    for (int x = -half; x <= half; ++x, ++row) {
      const auto t = [&](int du, int dv) { return image(pixel.x() + x + du, pixel.y() + y + dv); };
      const float tu = (t(1, 0) - t(-1, 0)) / 2, tv = (t(0, 1) - t(0, -1)) / 2;
      const float fx = static_cast<float>(x), fy = static_cast<float>(y);
      j.row(row) << tu, tv, fx * tu, fy * tu, fx * tv, fy * tv, t(0, 0), 1, t(1, 0) - 2 * t(0, 0) + t(-1, 0),
          (t(1, 1) - t(-1, 1) - t(1, -1) + t(-1, -1)) / 4, t(0, 1) - 2 * t(0, 0) + t(0, -1);
    }
  }
  patch.normal_ = (j.transpose() * j).cast<double>();
  const Eigen::Matrix2d structure = patch.normal_.topLeftCorner<2, 2>();
  if (!(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(structure).eigenvalues()[0] > pixels * least_slope)) {
    return std::nullopt;
  }
  // Nothing of a flat patch is divided by: the ridge is below rounding of any other.
  patch.normal_.diagonal().array() += 1e-6 * pixels;
  const Eigen::LDLT<Normal> solver(patch.normal_);
  const Eigen::MatrixXf wide = smoothed(j);
  patch.noise_ = (wide.transpose() * wide).cast<double>();
  patch.fitted_ = solver.solve(patch.noise_).trace();
  const auto shifted = [&](Eigen::Index by) {
    const Eigen::Index rest = wide.rows() - by;
    return wide.topLeftCorner(rest, 2).cwiseProduct(wide.bottomLeftCorner(rest, 2)).sum();
  };
  patch.correlation_ = (shifted(1) + shifted(side + 2)) / (2 * shifted(0));

  Eigen::MatrixXf scores = Eigen::MatrixXf::Zero(pixels, 18);
  for (int i = 0; i < pixels; ++i) {
    const int block = (i / side) / 7 * 3 + (i % side) / 7;
    scores.block<1, 2>(i, 2 * block) = j.block<1, 2>(i, 0);
  }
  const Eigen::MatrixXf alone = smoothed(scores);
  const Eigen::MatrixXf fit = solver.solve((j.transpose() * scores).cast<double>()).cast<float>();
  const Eigen::MatrixXf left = smoothed((scores - j * fit).eval());
  Eigen::Matrix<double, 18, 18> law = (left.transpose() * left).cast<double>();
  for (int b = 0; b < 9; ++b) {
    Eigen::Matrix2d m = (alone.middleCols<2>(2 * b).transpose() * alone.middleCols<2>(2 * b)).cast<double>();
    // A block without structure says nothing.
    m.diagonal().array() += 0.02 * pixels * least_slope;
    patch.block_weight_[static_cast<std::size_t>(b)] = m.inverse();
    law.middleRows<2>(2 * b) = (patch.block_weight_[static_cast<std::size_t>(b)] * law.middleRows<2>(2 * b)).eval();
  }
  patch.block_mean_ = law.trace();
  patch.block_freedom_ = patch.block_mean_ * patch.block_mean_ / (law * law).trace();
  return patch;
}

/// The slope with which the fit's score answers a shift of the image, over that of the template alone: the gradients of the
/// two images multiplied, so that the noise of neither counts, and a blurred image's are weaker.
double Patch::slopeRatio(const Eigen::Matrix<float, pixels, 1>& values, double gain) const {
  double cross = 0, own = 0;
  for (int y = 1; y + 1 < side; ++y) {
    const int row = y * side + 1;
    const auto tu = design_.block<side - 2, 1>(row, 0), tv = design_.block<side - 2, 1>(row, 1);
    cross += tu.dot(values.segment<side - 2>(row + 1) - values.segment<side - 2>(row - 1)) +
             tv.dot(values.segment<side - 2>(row + side) - values.segment<side - 2>(row - side));
    own += tu.squaredNorm() + tv.squaredNorm();
  }
  return std::clamp(cross / (2 * gain * own), 0.2, 1.2);
}

/// The share of the template's gradients' squares that is not noise.
double Patch::slopesWithoutNoise(double variance) const {
  return std::max(1 - 2 * pixels * slope_share * variance / (normal_(0, 0) + normal_(1, 1)), 0.5);
}

std::optional<PatchMatch> Patch::find(const SmoothImage& image, const Eigen::Vector2d& near, const PatchMatch& before,
                                      PatchFault& fault) {
  const auto failed = [&](PatchFault why) {
    fault = why;
    return std::nullopt;
  };
  fault = PatchFault::none;
  const double known = variance_count_ > 0 ? variance_sum_ / variance_count_ : first_variance;
  const double g0 = before.gain;
  // The prior of the affine, relative to the one before.
  Eigen::Matrix4d prior = before.affine_covariance;
  prior.diagonal().array() += affine_step * affine_step;
  const Eigen::Matrix4d weight = known * (1 + g0 * g0) / (g0 * g0) * prior.inverse();
  Normal damped = normal_;
  damped.block<4, 4>(2, 2) += weight;
  const Eigen::LDLT<Normal> solver(damped);

  PatchMatch match = before;
  match.at = near;
  Sampled values;
  Eigen::Matrix<double, columns, 1> theta;
  const Eigen::Matrix2d predicted_inverse = before.affine.inverse();
  bool done = false;
  for (int i = 0; i < max_iterations && !done; ++i) {
    if (!sample(image, match.at, match.affine, values)) return failed(PatchFault::outside);
    const Eigen::Matrix2d change = predicted_inverse * match.affine - Eigen::Matrix2d::Identity();
    const Eigen::Vector4d target(change(0, 0), change(0, 1), change(1, 0), change(1, 1));
    Eigen::Matrix<double, columns, 1> right = (design_.transpose() * values).cast<double>();
    right.segment<4>(2) += weight * (g0 * target);
    theta = solver.solve(right);
    match.gain = theta[6];
    if (!(match.gain > 0.3 && match.gain < 3)) return failed(PatchFault::not_alike);
    const Eigen::Vector2d shift = theta.head<2>() / match.gain;
    Eigen::Matrix2d inner;
    inner << theta[2], theta[3], theta[4], theta[5];
    inner = Eigen::Matrix2d::Identity() + inner / match.gain;
    if (!(std::abs(inner.determinant() - 1) < 0.5)) return failed(PatchFault::no_convergence);
    match.affine = (match.affine * inner.inverse()).eval();
    match.at -= match.affine * shift;
    if (!((match.at - near).norm() < farthest)) return failed(PatchFault::no_convergence);
    done = shift.norm() < converged;
  }
  if (!done) return failed(PatchFault::no_convergence);
  const Eigen::Vector2d scales = [&] {
    const Eigen::Matrix2d square = match.affine.transpose() * match.affine;
    return Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(square).eigenvalues().cwiseSqrt().eval();
  }();
  if (!(scales[0] > least_scale && scales[1] < largest_scale)) return failed(PatchFault::scale);

  const Sampled residual = values - design_ * theta.cast<float>();
  const double g2 = match.gain * match.gain, left = residual.squaredNorm();
  const double factor = interpolated(match, neighbour_correlation) + g2;
  const double variance = std::max(left / ((smooth_share * pixels - fitted_) * factor), 1. / 12);
  // The template's part of what is alike.
  const double mean = normal_(6, 7) / pixels, contrast = g2 * (normal_(6, 6) - pixels * mean * mean);
  if (!(left < 0.5 * contrast)) return failed(PatchFault::not_alike);
  if (variance_count_ > 0 && variance > largest_rise * known) return failed(PatchFault::not_alike);
  // The excess in one image is structure that the fit leaves, which the blocks judge.
  variance_sum_ += variance_count_ > 0 ? std::min(variance, largest_surprise * known) : variance;
  variance_count_ += 1;
  const double usual = variance_sum_ / variance_count_;
  match.noise = std::sqrt(usual);

  double disagreement = 0;
  for (int b = 0; b < 9; ++b) {
    Eigen::Vector2f score = Eigen::Vector2f::Zero();
    for (int v = 0; v < 7; ++v) {
      const int row = (b / 3 * 7 + v) * side + b % 3 * 7;
      score += design_.block<7, 2>(row, 0).transpose() * residual.segment<7>(row);
    }
    const Eigen::Vector2d s = score.cast<double>();
    disagreement += s.dot(block_weight_[static_cast<std::size_t>(b)] * s);
  }
  const double now = disagreement / (block_mean_ * usual * (1 + g2));
  // Misfit that no affine map explains stays from image to image, noise does not.
  misfit_ += (now - misfit_) / std::min(variance_count_, misfit_memory);
  match.misfit = std::max(misfit_, now > 1 + 3 * std::sqrt(2 / block_freedom_) ? now : 0);
  if (now > largest_misfit || (variance_count_ > 2 && misfit_ > largest_mean_misfit)) return failed(PatchFault::misfit);
  const double images = std::max(std::min(variance_count_, misfit_memory) / 2, 1.);
  if (!(match.misfit > 1 + significant_misfit * std::sqrt(2 / block_freedom_ / images))) match.misfit = 1;

  const double ratio = slopeRatio(values, match.gain);
  Normal sloped = ratio * normal_;
  sloped.block<4, 4>(2, 2) += weight;
  // Rows of place and affine map alone.
  const Eigen::Matrix<double, 6, columns> gain = sloped.inverse().topRows<6>();
  const Eigen::Matrix<double, 6, 4> of_prior = gain.middleCols<4>(2) * weight;
  const double kept = interpolated(match, correlation_);
  const double in_image = kept / std::abs(match.affine.determinant()) * match.misfit;
  // The template's noise moves a weaker image by more; so much of it is not common to all images.
  const double strength = ratio / (slopesWithoutNoise(usual) * std::sqrt(kept));
  const double weaker = 1 - std::min(strength * strength, 1.);
  const Eigen::Matrix<double, 6, 6> of_noise = usual * (gain * noise_ * gain.transpose());
  const Eigen::Matrix<double, 6, 6> alone =
      (in_image + weaker) / g2 * of_noise + of_prior * prior * of_prior.transpose();
  match.covariance = match.affine * alone.topLeftCorner<2, 2>() * match.affine.transpose();
  match.affine_covariance = (alone + of_noise).bottomRightCorner<4, 4>();
  if (!(match.covariance.trace() < 2 * largest_sigma * largest_sigma)) return failed(PatchFault::uncertain);
  return match;
}

Eigen::Matrix2d Patch::templateCovariance() const {
  const double variance = variance_count_ > 0 ? variance_sum_ / variance_count_ : first_variance;
  const Normal gain = normal_.inverse() / slopesWithoutNoise(variance);
  return (std::max(misfit_, 1.) * variance * gain * noise_ * gain.transpose()).topLeftCorner<2, 2>();
}

}  // namespace liestat
