// Notes of `liestat mean` on a result: axes, digits, rivals, weights, rows that depend on each other.
#include <cli/commands/mean_analysis.hpp>
#include <cli/commands/measurements.hpp>
#include <formats/features.hpp>
#include <cli/show/mean.hpp>
#include <report/json.hpp>

#include <gtest/gtest.h>

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace liestat::cli {
namespace {

struct Analysed {
  explicit Analysed(const std::string& text, const AnalysisOptions& options = {})
      : measurements(chooseMeasurements(readFeatures(text, "f.csv"), {}, "liestat mean")),
        analysis(analyseMean(measurements, options)) {}
  std::string text() const { return formatMean("f.csv", measurements, analysis); }
  nlohmann::json json() const {
    return nlohmann::json::parse(JsonObject().fieldsOf(measurements.file).fieldsOf<MeanSummary>(analysis).str());
  }
  /// The numbers of a row of the table.
  std::vector<double> row(const std::string& name) const {
    const TableRows table = meanRows(measurements, analysis);
    for (const auto& cells : table.rows) {
      if (cells[0] != name) continue;
      std::vector<double> numbers;
      for (std::size_t i = 1; i < 4; ++i) numbers.push_back(std::stod(cells[i]));
      return numbers;
    }
    ADD_FAILURE() << "no row '" << name << "' in\n" << text();
    return {};
  }
  bool says(const std::string& part) const { return text().find(part) != std::string::npos; }

  Measurements measurements;
  MeanAnalysis analysis;
};

/// Repeatable noise with a standard deviation near one.
double noise(std::uint64_t& state) {
  double sum = -6;
  for (int i = 0; i < 12; ++i) {
    state = state * 6364136223846793005U + 1442695040888963407U;
    sum += static_cast<double>(state >> 11) * 0x1p-53;
  }
  return sum;
}

// Ten poses that look along y, one behind the other along x: the mean is uncertain along the world's x.
TEST(MeanOutput, TranslationsHaveTheWorldsAxesBesideTheMean) {
  std::string text = "tx,ty,tz,rx,ry,rz\n";
  std::uint64_t state = 1;
  for (int i = 1; i <= 10; ++i) {
    text +=
        fmt::format("{},{},{},0,0,{}\n", i, 0.01 * noise(state), 0.01 * noise(state), M_PI / 2 + 1e-3 * noise(state));
  }
  const Analysed found(text);
  const double sd = std::sqrt(82.5 / 9 / 10);
  EXPECT_NEAR(found.row("translation")[0], 5.5, 1e-6);
  EXPECT_NEAR(found.row("  sd, world axes")[0], sd, 2e-3 * sd);
  EXPECT_LT(found.row("  sd, world axes")[1], 0.01);
  EXPECT_NEAR(found.row("  sd, body axes")[1], sd, 2e-3 * sd);
  EXPECT_LT(found.row("  sd, body axes")[0], 0.01);
  EXPECT_NEAR(found.row("  dispersion, world axes")[0], std::sqrt(8.25), 0.01);
  const auto json = found.json();
  EXPECT_NEAR(json.at("standard_deviations").at("translation_m")[1].get<double>(), sd, 2e-3 * sd) << "body axes";
}

TEST(MeanOutput, DigitsFollowTheStandardDeviation) {
  std::string text = "x,y,z\n";
  std::uint64_t state = 2;
  double sum = 0;
  for (int i = 0; i < 100; ++i) {
    const double x = 1.4e-4 * noise(state);
    sum += x;
    text += fmt::format("{:.9f},{:.9f},{:.9f}\n", 5400000 + x, -3e-7 + 1.4e-4 * noise(state), 1e-4 * noise(state));
  }
  const Analysed found(text);
  const double sd = found.row("  sd")[0];
  EXPECT_NEAR(sd, 1.4e-5, 4e-6);
  EXPECT_NEAR(found.row("point")[0], 5400000 + sum / 100, 0.01 * sd) << found.text();
}

// Errors of successive rows that are alike are found by their times, and --inflate widens the covariance.
TEST(MeanOutput, RowsWithTimesAreTestedForDependence) {
  std::uint64_t state = 3;
  const auto series = [&](double memory) {
    std::string text = "t,x,y,z\n";
    double x = 0, y = 0, z = 0;
    for (int i = 0; i < 400; ++i) {
      const double fresh = std::sqrt(1 - memory * memory);
      x = memory * x + fresh * noise(state), y = memory * y + fresh * noise(state),
      z = memory * z + fresh * noise(state);
      text += fmt::format("{},{:.6f},{:.6f},{:.6f}\n", 0.1 * i, x, y, z);
    }
    return text;
  };
  const std::string drifting = series(0.9);
  const Analysed dependent(drifting);
  ASSERT_TRUE(dependent.analysis.dependence.tested);
  EXPECT_GT(dependent.analysis.dependence.correlation_factor, 5);
  EXPECT_TRUE(dependent.says("not independent")) << dependent.text();
  EXPECT_FALSE(dependent.json().at("inflated").get<bool>());

  AnalysisOptions inflate;
  inflate.inflate = true;
  const Analysed inflated(drifting, inflate);
  const double factor = inflated.analysis.dependence.correlation_factor;
  EXPECT_EQ(factor, dependent.analysis.dependence.correlation_factor);
  // Each principal axis has a factor of its own; that of the result is their mean.
  const Eigen::MatrixXd gain = dependent.analysis.covariance.ldlt().solve(inflated.analysis.covariance);
  EXPECT_NEAR(gain.trace() / static_cast<double>(gain.rows()), factor, 1e-9 * factor);
  const Eigen::MatrixXd more = inflated.analysis.covariance - dependent.analysis.covariance;
  EXPECT_TRUE(more.ldlt().isPositive());
  EXPECT_FALSE(inflated.says("not independent"));

  const Analysed independent(series(0));
  ASSERT_TRUE(independent.analysis.dependence.tested);
  EXPECT_FALSE(independent.says("not independent")) << independent.text();
  const Analysed untimed("x,y,z\n1,2,3\n2,3,4\n3,4,6\n5,5,5\n");
  EXPECT_FALSE(untimed.analysis.dependence.tested);
}

// Two opposite directions have a circle of minima: the list of rivals is cut short, and says so.
TEST(MeanOutput, ListsThatWereCutShortSaySo) {
  const Analysed opposite("dx,dy,dz\n0,0,1\n0,0,-1\n");
  EXPECT_EQ(opposite.analysis.status, Status::ambiguous);
  EXPECT_TRUE(opposite.says("these are not all")) << opposite.text();
  EXPECT_FALSE(opposite.json().at("rivals_complete").get<bool>());
  const Analysed two("rx,ry,rz\n0,0,1.5707963267948966\n0,0,-1.5707963267948966\n");
  EXPECT_EQ(two.analysis.status, Status::ambiguous);
  EXPECT_FALSE(two.says("these are not all")) << two.text();
}

TEST(MeanOutput, MeasurementsWithoutWeightAreNotCounted) {
  const std::string rows = "1,2,3,1\n2,3,3,2\n3,1,4,1\n1,1,1,1\n2,2,2,3\n";
  const Analysed all("x,y,z,weight\n" + rows);
  for (const char* extra : {"100,100,100,0\n", "100,100,100,1e-300\n"}) {
    const Analysed found("x,y,z,weight\n" + rows + extra);
    EXPECT_EQ(found.json().at("n"), 5);
    EXPECT_EQ(found.analysis.covariance, all.analysis.covariance);
    EXPECT_TRUE(found.says("1 measurement has no weight beside the others and is not counted")) << found.text();
    EXPECT_FALSE(found.says("are equal"));
  }
}

// Rotation vectors beyond a half-turn are said.
TEST(MeanOutput, LongRotationVectorsAreSaid) {
  EXPECT_TRUE(Analysed("rx,ry,rz\n0,0,3.2\n0,0,3.1\n0,0,3.0\n0,0.1,3.0\n").says("longer than a half-turn"));
}

/// Small files that were answered wrongly once.
TEST(InputsThatFailed, haveTheRightAnswer) {
  const char* data = std::getenv("LIESTAT_DATA");
  if (data == nullptr) GTEST_SKIP() << "skipped: LIESTAT_DATA does not name the directory of the real measurements";
  const auto analysed = [&](const char* file, std::optional<Criterion> criterion) {
    const std::string path = std::string(data) + "/inputs-that-fail/" + file;
    return analyseMean(chooseMeasurements(readFeatureFile(path, {}), {.criterion = criterion}, "liestat mean"), {});
  };
  // Two clouds half a turn apart, each with its true covariance.
  for (const Criterion criterion : {Criterion::lsq, Criterion::wlsq, Criterion::maha}) {
    const MeanAnalysis clouds = analysed("two_clouds_with_covariances.csv", criterion);
    EXPECT_EQ(clouds.status, Status::inconsistent) << name(criterion);
    EXPECT_FALSE(clouds.trusted() || clouds.hasCovariance());
    EXPECT_LT(clouds.fit.p, 1e-3);
  }
  // A quarter of the signs flipped: a circle of minima.
  const MeanAnalysis ring = analysed("flipped_directions.csv", std::nullopt);
  EXPECT_EQ(ring.status, Status::ambiguous);
  // Deviations of 0.3 : 3e-6 : 3e-6 rad about common axes.
  const MeanAnalysis anisotropic = analysed("anisotropic_same_axes.csv", Criterion::maha);
  ASSERT_EQ(anisotropic.status, Status::ok) << anisotropic.reason;
  const Eigen::Matrix3d C = anisotropic.covariance;
  EXPECT_TRUE(C == C.transpose());
  const Eigen::Vector3d eigenvalues = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(C).eigenvalues();
  EXPECT_NEAR(eigenvalues[2], 1.8e-2, 1e-3);
  EXPECT_NEAR(eigenvalues[0], 1.8e-12, 1e-13);
  EXPECT_NEAR(eigenvalues[1], 1.8e-12, 1e-13);
}

/// Copies of one orientation by the rotations of 432: unlike rotations, equal as orientations.
TEST(MeanOutput, OrientationsOfCrystals) {
  std::string text = "rx,ry,rz\n";
  std::uint64_t state = 5;
  const SO3d grain = SO3d::exp({0.2, -0.3, 0.1});
  for (int i = 0; i < 12; ++i) {
    const Eigen::Vector3d error(0.01 * noise(state), 0.01 * noise(state), 0.01 * noise(state));
    const SO3d copy = grain * SO3d::exp(error) * SO3d::rotZ(i * M_PI / 2) * SO3d::rotX((i / 4) * M_PI / 2);
    text += fmt::format("{},{},{}\n", copy.log()[0], copy.log()[1], copy.log()[2]);
  }
  AnalysisOptions options;
  options.symmetry = PointGroup::fromName("m-3m");
  options.charts = true;
  const Analysed crystals(text, options);
  EXPECT_EQ(crystals.analysis.status, Status::ok);
  EXPECT_EQ(crystals.json().at("symmetry"), "432");
  EXPECT_LT((featureOf<SO3d>(crystals.analysis.mean).inverse() * grain).log().norm(), 0.02);
  EXPECT_LT(crystals.analysis.charts->centred.colwise().norm().maxCoeff(), 0.06);
  const Analysed rotations(text);
  EXPECT_FALSE(rotations.json().contains("symmetry"));
  EXPECT_GT(rotations.analysis.dispersion.trace(), 0.5);
}

}  // namespace
}  // namespace liestat::cli
