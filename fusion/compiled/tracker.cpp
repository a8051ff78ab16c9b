#include <fusion/tracking/tracker.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace liestat {
namespace {

/// Corners are looked for when so much of the tracks is left, and no sooner than so many images after the last time.
constexpr double enough = 0.85;
constexpr std::size_t least_wait = 3;
/// The neighbourhood in which a corner may have a rival, px, and how much alike a rival is.
constexpr int rival_reach = 24, rival_nearest = 6;
constexpr double rival_correlation = 0.7;

/// Observations before a sudden end that are not kept.
constexpr std::size_t doubtful = 4;

/// px to the nearest place round a pixel that looks like it; 0: none.
double rivalDistance(const SmoothImage& image, const Eigen::Vector2i& pixel) {
  constexpr int n = 11;
  const auto patchAt = [&](int u, int v, Eigen::Matrix<float, n * n, 1>& out) {
    for (int y = 0; y < n; ++y) {
      const float* const row = image.row(v + 2 * y - n + 1) + u - n + 1;
      for (int x = 0; x < n; ++x) out[y * n + x] = row[2 * x];
    }
    out.array() -= out.mean();
  };
  Eigen::Matrix<float, n * n, 1> own, other;
  patchAt(pixel.x(), pixel.y(), own);
  double nearest = std::numeric_limits<double>::infinity();
  for (int dv = -rival_reach; dv <= rival_reach; dv += 2) {
    for (int du = -rival_reach; du <= rival_reach; du += 2) {
      const int u = pixel.x() + du, v = pixel.y() + dv;
      const double distance = std::hypot(du, dv);
      if (distance < rival_nearest || distance >= nearest || std::min(u, v) < n || u + n >= image.width() ||
          v + n >= image.height()) {
        continue;
      }
      patchAt(u, v, other);
      if (own.dot(other) > rival_correlation * own.norm() * other.norm()) nearest = distance;
    }
  }
  return std::isfinite(nearest) ? nearest : 0;
}

TrackEnd endOf(PatchFault fault) {
  switch (fault) {
    case PatchFault::outside:
      return TrackEnd::border;
    case PatchFault::scale:
      return TrackEnd::scale;
    case PatchFault::misfit:
      return TrackEnd::misfit;
    case PatchFault::uncertain:
      return TrackEnd::uncertain;
    default:
      return TrackEnd::not_alike;
  }
}

double sigmaOf(const Eigen::Matrix2d& covariance) { return std::sqrt(covariance.trace() / 2); }

}  // namespace

void Tracker::take(const GreyView& image) {
  flow_.take(image);
  smooth_.take(image);
  follow();
  const bool few = static_cast<double>(alive_.size()) < enough * static_cast<double>(options_.tracks);
  if (image_ == 0 || (few && image_ - looked_ >= least_wait) || alive_.empty()) begin(image.width, image.height);
  ++image_;
}

void Tracker::follow() {
  if (alive_.empty()) return;
  std::vector<Eigen::Vector2d> from, guess;
  for (const Track& track : alive_) {
    from.push_back(track.match.at);
    guess.emplace_back(track.match.at + track.moved);
  }
  const std::vector<Eigen::Vector2d> to = flow_.follow(from, guess, options_.backward);
  std::vector<Track> kept;
  for (std::size_t i = 0; i < alive_.size(); ++i) {
    Track& track = alive_[i];
    if (!to[i].allFinite()) {
      end(track, TrackEnd::flow);
      continue;
    }
    PatchFault fault;
    const auto match = track.patch->find(smooth_, to[i], track.match, fault);
    if (!match) {
      end(track, endOf(fault));
      continue;
    }
    if (track.rival > 0 && (match->at - guess[i]).norm() > track.rival / 2) {
      end(track, TrackEnd::repeated);
      continue;
    }
    // Older tracks come first.
    const double least = options_.apart / 2;
    if (std::any_of(kept.begin(), kept.end(),
                    [&](const Track& k) { return (k.match.at - match->at).norm() < least; })) {
      end(track, TrackEnd::crowded);
      continue;
    }
    track.moved = match->at - track.match.at;
    track.match = *match;
    track.rows.push_back(rows_.size());
    rows_.push_back({image_, track.number, match->at.x(), match->at.y(), sigmaOf(match->covariance)});
    kept.push_back(std::move(track));
  }
  alive_ = std::move(kept);
}

void Tracker::begin(int width, int height) {
  looked_ = image_;
  if (options_.apart == 0) {
    const double room = std::sqrt(static_cast<double>(width) * height / static_cast<double>(options_.tracks));
    options_.apart = std::clamp(0.6 * room, 5., static_cast<double>(Patch::side));
  }
  if (alive_.size() >= options_.tracks) return;
  std::vector<Eigen::Vector2d> taken;
  for (const Track& track : alive_) taken.push_back(track.match.at);
  const std::size_t old = alive_.size();
  for (const Eigen::Vector2i& pixel : flow_.corners(taken, options_.tracks - old, options_.apart, Patch::margin)) {
    std::optional<Patch> patch = Patch::at(smooth_, pixel);
    if (!patch) continue;
    const Eigen::Vector2d at = pixel.cast<double>();
    // It is expected to move as the nearest track did that can't have been mistaken.
    Eigen::Vector2d moved = Eigen::Vector2d::Zero();
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < old; ++i) {
      const double distance = (alive_[i].match.at - at).norm();
      if (alive_[i].rival == 0 && distance < nearest) nearest = distance, moved = alive_[i].moved;
    }
    PatchMatch match;
    match.at = at;
    alive_.push_back({numbers_++,
                      {rows_.size()},
                      std::make_unique<Patch>(std::move(*patch)),
                      match,
                      moved,
                      rivalDistance(smooth_, pixel)});
    rows_.push_back({image_, alive_.back().number, at.x(), at.y(), 0});
  }
}

void Tracker::end(Track& track, TrackEnd why) {
  // The cause of its end may have begun before it was seen, and a template that few images confirmed may lie on an edge of depth.
  const bool sudden = why != TrackEnd::last_image && why != TrackEnd::border && why != TrackEnd::crowded;
  const std::size_t seen = track.rows.size(), kept = sudden ? seen - std::min(seen, doubtful) : seen;
  if (kept < 2) return drop(track, 0);
  drop(track, kept);
  rows_[track.rows.front()].sigma = sigmaOf(track.patch->templateCovariance());
  ended_.resize(std::max(ended_.size(), track.number + 1));
  ended_[track.number] = {seen, why};
}

/// Takes the observations after the first so many away.
void Tracker::drop(Track& track, std::size_t kept) {
  for (std::size_t i = kept; i < track.rows.size(); ++i) rows_[track.rows[i]].sigma = 0;
}

std::vector<TrackedPoint> Tracker::finish() {
  for (Track& track : alive_) end(track, TrackEnd::last_image);
  alive_.clear();
  std::vector<TrackedPoint> rows = std::move(rows_);
  rows_.clear();
  // How many images there are is known only now.
  const std::size_t least = std::min(options_.least, image_);
  std::erase_if(rows, [&](const TrackedPoint& p) { return p.sigma == 0 || ended_[p.track].seen < least; });
  for (const Ended& track : ended_) {
    if (track.seen >= std::max<std::size_t>(least, 1)) ++ends_[static_cast<std::size_t>(track.why)];
  }
  std::sort(rows.begin(), rows.end(), [](const TrackedPoint& a, const TrackedPoint& b) {
    return std::pair(a.image, a.track) < std::pair(b.image, b.track);
  });
  return rows;
}

}  // namespace liestat
