// Means of real landmarks against surveyed positions, and what the covariances of such means are worth (Pennec 1998,
// section 5.2, on real data). The bounds are figures of an independent prototype: 20.2, 10.6 and 10.8 mm RMS, squared
// Mahalanobis distances from 12 to 400.
#include <stats/maha.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include <formats/tracks.hpp>

namespace liestat::cli {
namespace {

class StarryNight : public testing::Test {
 protected:
  void SetUp() override {
    const char* data = std::getenv("LIESTAT_DATA");
    if (data == nullptr) GTEST_SKIP() << "skipped: LIESTAT_DATA does not name the directory of the real measurements";
    const std::string files = std::string(data) + "/tracks/starry_night_";
    surveyed = readLandmarks(files + "landmarks.csv");
    measurements = backProject(readStereoTracks(files + "tracks.csv"), readCameraPoses(files + "poses.csv"),
                               readStereoCamera(files + "camera.csv"));
  }

  /// RMS distance (mm) between what `estimate` makes of a landmark's measurements and its surveyed position.
  template <class Estimate>
  double rms(const Estimate& estimate) const {
    double sum = 0;
    for (const LandmarkMeasurements& landmark : measurements) {
      sum += (estimate(landmark.points) - surveyed.at(landmark.track)).squaredNorm();
    }
    return 1000 * std::sqrt(sum / static_cast<double>(measurements.size()));
  }

  std::vector<Eigen::Vector3d> surveyed;
  std::vector<LandmarkMeasurements> measurements;
};

std::vector<Eigen::Vector3d> means(const std::vector<MeasuredPoint>& points) {
  std::vector<Eigen::Vector3d> list;
  for (const MeasuredPoint& point : points) list.push_back(point.mean);
  return list;
}

TEST_F(StarryNight, EveryObservationIsUsed) {
  ASSERT_EQ(measurements.size(), 20U);
  std::size_t n = 0;
  for (const LandmarkMeasurements& landmark : measurements) n += landmark.points.size();
  EXPECT_EQ(n, 9410U);
}

TEST_F(StarryNight, MeansAgainstTheSurvey) {
  EXPECT_NEAR(rms([](const auto& points) { return mean(means(points)).mean; }), 20.2, 0.1);
  EXPECT_NEAR(rms([](const auto& points) {
                std::vector<double> weights;
                for (const MeasuredPoint& point : points) weights.push_back(scalarWeight(point.covariance));
                return mean(means(points), weights).mean;
              }),
              10.6, 0.1);
  EXPECT_NEAR(rms([](const auto& points) { return maha(points).mean; }), 10.8, 0.1);
}

TEST_F(StarryNight, CovariancesOfIndependentErrorsAreFarTooSmall) {
  for (const LandmarkMeasurements& landmark : measurements) {
    const double mu2 = mahalanobisSquared(testedFuse(landmark.points).estimate, surveyed.at(landmark.track));
    EXPECT_GT(mu2, 11) << "track " << landmark.track;  // χ²_3 is above with a probability of 1 %
    EXPECT_LT(mu2, 400) << "track " << landmark.track;
  }
}

/// The factor by which the means of parts of the data disagree more than their covariances say.
double disagreement(const std::vector<std::vector<MeasuredPoint>>& parts, const Eigen::Vector3d& whole) {
  double sum = 0;
  for (const auto& part : parts) sum += mahalanobisSquared(testedFuse(part).estimate, whole);
  return sum / (3 * static_cast<double>(parts.size() - 1));
}

TEST_F(StarryNight, BlocksOfTimeRevealItWithoutTheSurvey) {
  constexpr std::size_t blocks = 8;
  double by_time = 0, interleaved = 0;
  for (const LandmarkMeasurements& landmark : measurements) {
    std::vector<std::vector<MeasuredPoint>> consecutive(blocks), every_eighth(blocks);
    const std::size_t n = landmark.points.size();
    for (std::size_t i = 0; i < n; ++i) {
      consecutive[i * blocks / n].push_back(landmark.points[i]);
      every_eighth[i % blocks].push_back(landmark.points[i]);
    }
    const Eigen::Vector3d whole = maha(landmark.points).mean;
    by_time += disagreement(consecutive, whole) / 20;
    interleaved += disagreement(every_eighth, whole) / 20;
  }
  EXPECT_LT(interleaved, 2);
  EXPECT_GT(by_time, 10 * interleaved);
  // Inflated by the common factor, the distances to the survey are of the size that they should have.
  double mu2 = 0;
  for (const LandmarkMeasurements& landmark : measurements) {
    mu2 += mahalanobisSquared(testedFuse(landmark.points).estimate, surveyed.at(landmark.track)) / 20;
  }
  EXPECT_GT(mu2 / by_time, 1);
  EXPECT_LT(mu2 / by_time, 9);
}

}  // namespace
}  // namespace liestat::cli
