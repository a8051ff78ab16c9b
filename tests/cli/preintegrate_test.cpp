// `liestat preintegrate`: recordings and calibrations, good and bad, and what the program makes of them.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include <formats/calibration.hpp>
#include <report/run_program.hpp>
#include <formats/imu.hpp>
#include <support/temporary_directory.hpp>

namespace liestat::cli {
namespace {

using Json = nlohmann::json;

const std::string header = "#timestamp [ns],w_x [rad s^-1],w_y,w_z,a_x [m s^-2],a_y,a_z\n";

TEST(ImuFiles, EurocKeepsNanoseconds) {
  const ImuFile file = parseImu(header + "1403715523912143104,1,2,3,0,0,9.8\n1403715523912143105,4,5,6,0,1,9\n", "f");
  ASSERT_EQ(file.samples.size(), 2U);
  EXPECT_EQ(file.start_ns, 1403715523912143104);
  EXPECT_EQ(file.samples[0].time, 0);
  EXPECT_EQ(file.samples[1].time, 1e-9);
  EXPECT_EQ(file.samples[1].angular_rate, Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(file.samples[1].specific_force, Eigen::Vector3d(0, 1, 9));
  EXPECT_EQ(file.lines[1], 3U);
  EXPECT_EQ(file.format, "euroc");
}

TEST(ImuFiles, CsvHasNamedColumns) {
  const ImuFile file = parseImu("az,t,wx,wy,wz,ax,ay\n9,0.5,1,2,3,4,5\n9,0.75,1,2,3,4,5\n", "f");
  ASSERT_EQ(file.samples.size(), 2U);
  EXPECT_EQ(file.samples[0].time, 0.5);
  EXPECT_EQ(file.samples[0].specific_force, Eigen::Vector3d(4, 5, 9));
  EXPECT_EQ(file.format, "csv");
}

TEST(ImuFiles, BadOnesAreNamed) {
  const auto message = [](const std::string& text) { return errorOf([&] { parseImu(text, "f"); }); };
  const std::string first = "1403715523912143104,0,0,0,0,0,9.8\n";
  EXPECT_EQ(message(""), "f: the file has no data");
  EXPECT_EQ(message(header + first), "f: there is one reading, expected two at least");
  EXPECT_EQ(message(header + first + first), "f:3: the time is that of line 2 again, expected times that ascend");
  EXPECT_EQ(message(header + first + "1403715523812143104,0,0,0,0,0,9.8\n"),
            "f:3: the time is 0.1 s before that of line 2, expected times that ascend");
  EXPECT_EQ(message(header + first + "1403715523912143204,0,0,0,0,nan,9.8\n").substr(0, 4), "f:3:");
  EXPECT_EQ(message(header + first + "1403715523912143204,0,0\n").substr(0, 14), "f:3: 3 fields,");
  EXPECT_EQ(message(header + first + "-1403715523912143204,0,0,0,0,0,1\n"),
            "f:3: timestamp is '-1403715523912143204', expected a whole number of nanoseconds");
  EXPECT_EQ(message("t,wx,wy,wz,ax,ay,az\n0,0,0,0,0,0,1\n1,0,0,0,0,0,1.02\n"),
            "f: specific forces are 1.01 in the mean: in g?, expected m/s^2, some 9.8 at rest");
  EXPECT_EQ(message("t,wx,wy,wz,ax,ay,az\n0,90,0,0,0,0,9\n1,90,0,0,0,0,9\n"),
            "f: angular rates are 90 in the mean: in degrees a second?, expected rad/s");
}

TEST(Calibrations, DensitiesOfEurocAndOfKalibr) {
  const std::string densities =
      "gyroscope_noise_density: 1e-4\ngyroscope_random_walk: 2e-5\naccelerometer_noise_density: 2e-3 # m\n"
      "accelerometer_random_walk: 3e-3\n";
  const auto check = [](const ImuNoise<double>& noise) {
    EXPECT_EQ(noise.gyroscope, 1e-4);
    EXPECT_EQ(noise.gyroscope_walk, 2e-5);
    EXPECT_EQ(noise.accelerometer, 2e-3);
    EXPECT_EQ(noise.accelerometer_walk, 3e-3);
  };
  check(parseImuNoise("sensor_type: imu\nrate_hz: 200\n" + densities, "f"));
  check(
      parseImuNoise("%YAML:1.0\n\nimu0:\n  accelerometer_noise_density: 2e-3\n  gyroscope_random_walk: 2e-5\n"
                    "  accelerometer_random_walk: 3e-3\n  gyroscope_noise_density: 1e-4\n",
                    "f"));
  const auto message = [](const std::string& text) { return errorOf([&] { parseImuNoise(text, "f"); }); };
  EXPECT_EQ(message("gyroscope_noise_density: 1e-4\n"),
            "f: there is no accelerometer_noise_density, expected the densities of noise and walk of an IMU");
  EXPECT_EQ(message("a: 1\n" + densities + "x: [1, 2\n").substr(0, 2), "f:");
  EXPECT_EQ(message("gyroscope_noise_density: -1\n"),
            "f:1: gyroscope_noise_density is '-1', expected a number of zero or more");
  EXPECT_EQ(message("just words"), "f: this is no YAML file of named values");
}

/// One run with JSON.
struct Outcome {
  int status = -1;
  std::string errors;
  Json json;
};
Outcome preintegrate(const TemporaryDirectory& directory, std::vector<std::string> options) {
  std::vector<std::string> arguments{LIESTAT_PROGRAM, "preintegrate", "--json", "out.json"};
  arguments.insert(arguments.end(), options.begin(), options.end());
  const ProgramResult result = runProgram(arguments, directory.path().string());
  EXPECT_TRUE(result.found) << result.errors;
  Outcome run{result.status, result.errors, nullptr};
  if (std::filesystem::exists(directory / "out.json")) run.json = Json::parse(contentOf(directory / "out.json"));
  return run;
}

TEST(PreintegrateReport, ShowsIncrementsTheirDeviationsAndTheReadings) {
  const TemporaryDirectory directory;
  std::string text = "t,wx,wy,wz,ax,ay,az\n";
  for (int i = 0; i <= 200; ++i) text += std::to_string(10 + 0.05 * i) + ",0,0,0.5,0,0,3\n";
  directory.write("f.csv", text);
  const Outcome run =
      preintegrate(directory, {"--imu", "f.csv", "--noise", "0.001,0.01", "--window", "2", "--report", "page"});
  ASSERT_EQ(run.status, 0) << run.errors;
  const std::string page = contentOf(directory / "page/index.html");
  EXPECT_NE(page.find("<p class=\"verdict good\">✓ ok: all of the 5 windows have an increment.</p>"),
            std::string::npos);
  for (const char* text_of_page : {"<th scope=\"col\" class=\"number\">sd turn deg</th>", "Growth of the standard",
                                   "median rate, Hz", ">20</td>"}) {
    EXPECT_NE(page.find(text_of_page), std::string::npos) << text_of_page;
  }
  for (const char* file : {"increments", "growth", "readings"}) {
    EXPECT_TRUE(std::filesystem::exists(directory / "page/" + file + ".csv")) << file;
  }
  EXPECT_FALSE(std::filesystem::exists(directory / "page/errors.csv")) << "there is no truth";
  // The growth ends with the window's own deviation.
  const std::string growth = contentOf(directory / "page/growth.csv");
  const std::size_t second = growth.find("\n\n");
  const std::string end = growth.substr(growth.rfind('\n', second - 1) + 1, 60);
  const double sd = std::sqrt(run.json["windows"][0]["covariance"][5][5].get<double>()) * 180 / 3.14159265358979323846;
  ASSERT_EQ(end.substr(0, 4), ",,2,") << end;
  EXPECT_NEAR(std::stod(end.substr(4)), sd, 1e-6 * sd) << end;
}

TEST(PreintegrateReport, SaysWhichWindowsHaveNone) {
  const TemporaryDirectory directory;
  std::string text = "t,wx,wy,wz,ax,ay,az\n";
  for (int i = 0; i <= 100; ++i) {
    if (i < 50 || i > 60) text += std::to_string(0.05 * i) + ",0,0,0.5,0,0,3\n";
  }
  directory.write("f.csv", text);
  Outcome run = preintegrate(directory, {"--imu", "f.csv", "--window", "1", "--report", "page"});
  ASSERT_EQ(run.status, 0) << run.errors;
  std::string page = contentOf(directory / "page/index.html");
  EXPECT_NE(page.find("<p class=\"verdict bad\">✗ INCOMPLETE: 2 of 5 windows have no increment"), std::string::npos);
  EXPECT_NE(page.find(">gap</td>"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(directory / "page/growth.csv")) << "the noise is not known";
  run = preintegrate(directory, {"--imu", "f.csv", "--report", "page"});
  EXPECT_EQ(run.status, 3);
  EXPECT_NE(contentOf(directory / "page/index.html").find("✗ NOT TO BE TRUSTED: "), std::string::npos);
  run = preintegrate(directory, {"--imu", "f.csv", "--report", "-"});
  EXPECT_EQ(run.status, 2);
  EXPECT_NE(run.errors.find("a directory is expected"), std::string::npos) << run.errors;
}

TEST(Preintegrate, AConstantForceForTwoSeconds) {
  const TemporaryDirectory directory;
  std::string text = "t,wx,wy,wz,ax,ay,az\n";
  for (int i = 0; i <= 40; ++i) text += std::to_string(10 + 0.05 * i) + ",0,0,0.5,0,0,3\n";
  directory.write("f.csv", text);
  const Outcome run = preintegrate(directory, {"--imu", "f.csv", "--noise", "0.001,0.01"});
  ASSERT_EQ(run.status, 0) << run.errors;
  ASSERT_EQ(run.json["windows"].size(), 1U);
  const Json w = run.json["windows"][0];
  EXPECT_EQ(w["status"], "ok");
  EXPECT_NEAR(w["duration"].get<double>(), 2, 1e-12);
  EXPECT_NEAR(w["rotation_vector"][2].get<double>(), 1, 1e-12);
  EXPECT_NEAR(w["velocity"][2].get<double>(), 6, 1e-12);
  EXPECT_NEAR(w["position"][2].get<double>(), 6, 1e-12);
  // White noise of a rate over two seconds, of whose 41 readings the first and the last count half; of a force along the
  // axis of rotation.
  EXPECT_NEAR(w["covariance"][5][5].get<double>(), 2e-6 * 39.5 / 40, 1e-12);
  EXPECT_NEAR(w["covariance"][8][8].get<double>(), 2e-4, 1e-4);
  EXPECT_EQ(w["bias_jacobian"].size(), 9U);

  const Outcome windows = preintegrate(directory, {"--imu", "f.csv", "--window", "0.5"});
  ASSERT_EQ(windows.json["windows"].size(), 4U);
  EXPECT_TRUE(windows.json["windows"][0]["covariance"].is_null()) << "nothing is known of the noise";
}

TEST(Preintegrate, WhatCannotBeUsedIsSaid) {
  const TemporaryDirectory directory;
  directory.write("f.csv", "t,wx,wy,wz,ax,ay,az\n0,0,0,0,0,0,9\n0.05,0,0,0,0,0,9\n0.4,0,0,0,0,0,9\n0.45,0,0,0,0,0,9\n");
  const Outcome gap = preintegrate(directory, {"--imu", "f.csv"});
  EXPECT_EQ(gap.status, 3);
  EXPECT_EQ(gap.json["windows"][0]["status"], "gap");
  const Outcome some = preintegrate(directory, {"--imu", "f.csv", "--window", "0.05"});
  EXPECT_EQ(some.status, 0) << "windows beside the gap";
  EXPECT_EQ(some.json["windows"][0]["status"], "ok");
  EXPECT_EQ(some.json["windows"][2]["status"], "gap");
  EXPECT_EQ(some.json["windows"][2]["fault_time"], 0.4) << "the reading after the gap";
  EXPECT_EQ(preintegrate(directory, {"--imu", "f.csv", "--begin", "3"}).status, 2);
  EXPECT_EQ(preintegrate(directory, {"--imu", "f.csv", "--window", "7"}).status, 2);
  for (const char* window : {"1e-300", "nan", "inf", "0"}) {
    EXPECT_EQ(preintegrate(directory, {"--imu", "f.csv", "--window", window}).status, 2) << window;
  }
  EXPECT_EQ(preintegrate(directory, {"--imu", "none.csv"}).status, 2);
}

// The data's README: over a second, with the biases of the ground truth, medians of 1.3e-3 rad, 4.3e-2 m/s, 2.5e-2 m.
TEST(Preintegrate, Euroc) {
  const char* data = std::getenv("LIESTAT_DATA");
  if (data == nullptr) GTEST_SKIP() << "LIESTAT_DATA is not set";
  const std::string folder = std::string(data) + "/vi/euroc/";
  const TemporaryDirectory directory;
  const Outcome run = preintegrate(
      directory, {"--imu", folder + "V1_02_medium_imu0.csv", "--calibration", folder + "kalibr_imu_chain.yaml",
                  "--truth", folder + "V1_02_medium_gt.csv", "--begin", "2", "--window", "1"});
  // The noise of a data sheet does not explain the errors in flight, nor those of the ground truth.
  ASSERT_EQ(run.status, 3) << run.errors;
  EXPECT_EQ(run.json["consistent"], false);
  EXPECT_EQ(run.json["verdict"].get<std::string>().rfind("INCONSISTENT with the truth", 0), 0U);
  std::vector<double> rotation, velocity, position;
  for (const Json& w : run.json["windows"]) {
    EXPECT_EQ(w["status"], "ok");
    if (!w.contains("error")) continue;
    const auto norm = [&](int k) {
      return std::hypot(w["error"][k].get<double>(), w["error"][k + 1].get<double>(), w["error"][k + 2].get<double>());
    };
    position.push_back(norm(0)), rotation.push_back(norm(3)), velocity.push_back(norm(6));
  }
  ASSERT_GE(rotation.size(), 80U);
  const auto median = [](std::vector<double> v) {
    std::nth_element(v.begin(), v.begin() + 41, v.end());
    return v[41];
  };
  EXPECT_NEAR(median(rotation), 1.3e-3, 1e-4);
  EXPECT_NEAR(median(velocity), 4.3e-2, 3e-3);
  EXPECT_NEAR(median(position), 2.5e-2, 2e-3);
}

}  // namespace
}  // namespace liestat::cli
