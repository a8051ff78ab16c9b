// Real data: twenty landmarks seen by a stereo camera whose motion was measured. Every observation is put into the
// world with its covariance; LSQ, WLSQ and MAHA means of a landmark's observations are compared with its surveyed
// position.
//
//   starry_night [DIRECTORY]     the directory that holds tracks/starry_night_*.csv; else the environment's
//   LIESTAT_DATA
//
// The covariance of these means is far too small, and no formula for independent errors can help: those of successive
// frames are alike. That is seen without knowing the truth. Let the means of several parts of the data be compared
// under their own covariances: parts drawn at random agree, for each has its share of every common error; parts that
// are blocks of time do not. The ratio is the factor by which the covariance is too small.
#include <cli/io/stereo.hpp>
#include <cli/show/table.hpp>
#include <cli/io/tracks.hpp>

#include <stats/maha.hpp>
#include <stats/random.hpp>

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

using namespace liestat;
using cli::MeasuredPoint;

/// Σ_b μ²(m_b, m)/(k (b - 1)) over blocks of consecutive measures, m_b their means: 1 is expected if the measures are
/// independent and their covariances right.
double disagreement(const std::vector<MeasuredPoint>& points, std::size_t blocks) {
  const Eigen::Vector3d whole = fuse(points).mean;
  double sum = 0;
  for (std::size_t b = 0; b < blocks; ++b) {
    const ChunkRange range = chunkRange(points.size(), blocks, b);
    const std::vector<MeasuredPoint> part(points.begin() + static_cast<std::ptrdiff_t>(range.begin),
                                          points.begin() + static_cast<std::ptrdiff_t>(range.end));
    sum += mahalanobisSquared(fuse(part), whole);
  }
  return sum / (3 * static_cast<double>(blocks - 1));
}

/// The same measures in another order.
std::vector<MeasuredPoint> shuffled(std::vector<MeasuredPoint> points, CounterRng& rng) {
  for (std::size_t i = points.size(); i > 1; --i) std::swap(points[i - 1], points[rng() % i]);
  return points;
}

int run(const std::string& files) {
  const auto landmarks = cli::readLandmarks(files + "landmarks.csv");
  const auto measures =
      cli::backProject(cli::readStereoTracks(files + "tracks.csv"), cli::readCameraPoses(files + "poses.csv"),
                       cli::readStereoCamera(files + "camera.csv"));

  constexpr std::size_t blocks = 8;
  cli::Table table({"landmark", "n", "LSQ", "WLSQ", "MAHA", "mu2", "random", "by time", "inflated"});
  Eigen::Vector3d squared_errors = Eigen::Vector3d::Zero();
  for (const cli::LandmarkMeasures& landmark : measures) {
    const Eigen::Vector3d& surveyed = landmarks.at(landmark.track);
    std::vector<Eigen::Vector3d> points;
    std::vector<double> weights;
    for (const MeasuredPoint& point : landmark.points) {
      points.push_back(point.mean);
      weights.push_back(scalarWeight(point.covariance));
    }
    const MeasuredPoint fused = fuse(landmark.points);
    const Eigen::Vector3d errors((mean(points).mean - surveyed).norm(), (mean(points, weights).mean - surveyed).norm(),
                                 (fused.mean - surveyed).norm());
    squared_errors += errors.cwiseAbs2();

    CounterRng rng(1, landmark.track);
    const double mu2 = mahalanobisSquared(fused, surveyed);
    const double random = disagreement(shuffled(landmark.points, rng), blocks);
    const double by_time = disagreement(landmark.points, blocks);
    const auto millimetres = [](double metres) { return cli::number(1000 * metres, 3); };
    table.row({std::to_string(landmark.track), std::to_string(points.size()), millimetres(errors[0]),
               millimetres(errors[1]), millimetres(errors[2]), cli::number(mu2, 3), cli::number(random, 2),
               cli::number(by_time, 2), cli::number(mu2 / by_time, 2)});
  }
  const Eigen::Vector3d rms = (squared_errors / static_cast<double>(measures.size())).cwiseSqrt();
  std::printf("%s\nRMS over %zu landmarks: LSQ %.1f, WLSQ %.1f, MAHA %.1f mm\n\n", table.str().c_str(), measures.size(),
              1000 * rms[0], 1000 * rms[1], 1000 * rms[2]);
  std::printf(
      "LSQ, WLSQ, MAHA  distance of the mean from the surveyed position, mm\n"
      "mu2              squared Mahalanobis distance of the two for MAHA; 3 expected\n"
      "random, by time  disagreement of the means of %zu parts; 1 expected. Parts drawn\n"
      "                 at random, and blocks of time: the factor to inflate the covariance\n"
      "inflated         mu2 after that: of the order of 3. Eight blocks give the factor\n"
      "                 roughly, and an error that all blocks share is in none of them\n",
      blocks);
  return 0;
}

int main(int argc, char** argv) {
  const char* from_environment = std::getenv("LIESTAT_DATA");
  const std::string directory = argc > 1 ? argv[1] : from_environment ? from_environment : "";
  const std::string files = directory + "/tracks/starry_night_";
  if (directory.empty() || !std::filesystem::exists(files + "tracks.csv")) {
    std::printf("skipped: no tracks/starry_night_tracks.csv; name its directory, or set LIESTAT_DATA\n");
    return 77;
  }
  try {
    return run(files);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
