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
#include <lie/rn.hpp>
#include <stats/maha.hpp>
#include <stats/random.hpp>

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

using namespace liestat;
using MeasuredPoint = Gaussian<Eigen::Vector3d>;  // in m

/// The rows of a CSV file of numbers below a line of headers. A first column of names is left out.
std::vector<std::vector<double>> readRows(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error(path + ": cannot be read");
  std::vector<std::vector<double>> rows;
  std::string line, cell;
  std::getline(file, line);
  while (std::getline(file, line)) {
    std::istringstream cells(line);
    rows.emplace_back();
    while (std::getline(cells, cell, ',')) {
      char* end = nullptr;
      const double value = std::strtod(cell.c_str(), &end);
      if (end != cell.c_str()) rows.back().push_back(value);
    }
  }
  return rows;
}

/// A rectified stereo pair: focal lengths and principal point (pixels), baseline (m), variances of uL, vL, uR, vR.
struct StereoCamera {
  double fu, fv, cu, cv, b;
  Eigen::Vector4d variance;
};

StereoCamera readCamera(const std::string& path) {
  std::map<std::string, double> value;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    const std::size_t comma = line.find(',');
    if (comma != std::string::npos) value[line.substr(0, comma)] = std::strtod(line.c_str() + comma + 1, nullptr);
  }
  return {value.at("fu"), value.at("fv"),
          value.at("cu"), value.at("cv"),
          value.at("b"),  {value.at("y_var0"), value.at("y_var1"), value.at("y_var2"), value.at("y_var3")}};
}

/// The point that the pair sees, in the coordinates of the left camera, with the covariance of the pixels carried over
/// by the derivative: depth from the disparity, and the two rows averaged by their variances.
MeasuredPoint triangulate(const StereoCamera& camera, double uL, double vL, double uR, double vR) {
  const Eigen::Vector4d& variance = camera.variance;
  const double disparity = uL - uR, depth = camera.fu * camera.b / disparity;
  const double share = variance[3] / (variance[1] + variance[3]);  // weight of the left row
  const Eigen::Vector3d ray((uL - camera.cu) / camera.fu, (share * vL + (1 - share) * vR - camera.cv) / camera.fv, 1);
  Eigen::Matrix<double, 3, 4> J;
  J.col(0) = -depth / disparity * ray + depth / camera.fu * Eigen::Vector3d::UnitX();
  J.col(1) = share * depth / camera.fv * Eigen::Vector3d::UnitY();
  J.col(2) = depth / disparity * ray;
  J.col(3) = (1 - share) * depth / camera.fv * Eigen::Vector3d::UnitY();
  return {depth * ray, J * variance.asDiagonal() * J.transpose()};
}

/// All that was seen of each landmark, in the world and in the order of the frames.
std::map<std::size_t, std::vector<MeasuredPoint>> readMeasurements(const std::string& files) {
  const StereoCamera camera = readCamera(files + "camera.csv");
  // frame, time, the rotation that takes world to camera coordinates by rows, the camera's centre in the world.
  std::map<double, std::vector<double>> pose_of;
  for (const auto& row : readRows(files + "poses.csv")) pose_of[row.at(0)] = row;
  std::map<std::pair<double, double>, std::vector<double>> observations;  // by track and frame
  for (const auto& row : readRows(files + "tracks.csv")) observations[{row.at(1), row.at(0)}] = row;

  std::map<std::size_t, std::vector<MeasuredPoint>> landmarks;
  for (const auto& [key, row] : observations) {
    const auto pose = pose_of.find(key.second);
    if (pose == pose_of.end() || !(row.at(2) - row.at(4) >= 1)) continue;  // a disparity of a pixel at least
    const MeasuredPoint seen = triangulate(camera, row.at(2), row.at(3), row.at(4), row.at(5));
    const std::vector<double>& p = pose->second;
    Eigen::Matrix3d camera_R_world;
    camera_R_world << p.at(2), p.at(3), p.at(4), p.at(5), p.at(6), p.at(7), p.at(8), p.at(9), p.at(10);
    const Eigen::Matrix3d world_R_camera = camera_R_world.transpose();
    landmarks[static_cast<std::size_t>(key.first)].push_back(
        {world_R_camera * seen.mean + Eigen::Vector3d(p.at(11), p.at(12), p.at(13)),
         world_R_camera * seen.covariance * camera_R_world});
  }
  return landmarks;
}

/// Σ_b μ²(m_b, m)/(k (b - 1)) over blocks of consecutive measurements, m_b their means: 1 is expected if the
/// measurements are independent and their covariances right.
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

/// The same measurements in another order.
std::vector<MeasuredPoint> shuffled(std::vector<MeasuredPoint> points, CounterRng& rng) {
  for (std::size_t i = points.size(); i > 1; --i) std::swap(points[i - 1], points[rng() % i]);
  return points;
}

int run(const std::string& files) {
  const std::vector<std::vector<double>> survey = readRows(files + "landmarks.csv");
  const auto measurements = readMeasurements(files);

  constexpr std::size_t blocks = 8;
  std::printf("landmark    n   LSQ  WLSQ  MAHA    mu2  random  by time  inflated\n");
  Eigen::Vector3d squared_errors = Eigen::Vector3d::Zero();
  for (const auto& [track, seen] : measurements) {
    const Eigen::Vector3d surveyed(survey.at(track).at(0), survey.at(track).at(1), survey.at(track).at(2));
    std::vector<Eigen::Vector3d> points;
    std::vector<double> weights;
    for (const MeasuredPoint& point : seen) {
      points.push_back(point.mean);
      weights.push_back(scalarWeight(point.covariance));
    }
    const MeasuredPoint fused = fuse(seen);
    const Eigen::Vector3d errors((mean(points).mean - surveyed).norm(), (mean(points, weights).mean - surveyed).norm(),
                                 (fused.mean - surveyed).norm());
    squared_errors += errors.cwiseAbs2();

    CounterRng rng(1, track);
    const double mu2 = mahalanobisSquared(fused, surveyed);
    const double random = disagreement(shuffled(seen, rng), blocks);
    const double by_time = disagreement(seen, blocks);
    std::printf("%8zu %4zu %5.1f %5.1f %5.1f %6.1f %7.2f %8.1f %9.2f\n", track, seen.size(), 1000 * errors[0],
                1000 * errors[1], 1000 * errors[2], mu2, random, by_time, mu2 / by_time);
  }
  const Eigen::Vector3d rms = (squared_errors / static_cast<double>(measurements.size())).cwiseSqrt();
  std::printf("\nRMS over %zu landmarks: LSQ %.1f, WLSQ %.1f, MAHA %.1f mm\n\n", measurements.size(), 1000 * rms[0],
              1000 * rms[1], 1000 * rms[2]);
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
