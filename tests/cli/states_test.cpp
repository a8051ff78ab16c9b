// Arrays of NumPy, means of files that stay on the disk, states that are written and merged.
#include <cli/program_output.hpp>

#include <gtest/gtest.h>

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace liestat::cli {
namespace {

/// A .npy file of version 1.
std::string npy(const std::string& type, const std::string& shape, const std::string& numbers,
                const std::string& order = "False") {
  std::string header = "{'descr': " + type + ", 'fortran_order': " + order + ", 'shape': " + shape + ", }";
  header.resize(((header.size() + 11 + 63) / 64) * 64 - 11, ' ');
  header += '\n';
  std::string file = "\x93NUMPY";
  file += '\1', file += '\0';
  file += static_cast<char>(header.size() % 256), file += static_cast<char>(header.size() / 256);
  return file + header + numbers;
}
template <class S>
std::string bytesOf(const std::vector<double>& numbers) {
  std::string bytes;
  for (const double x : numbers) {
    const S narrow = static_cast<S>(x);
    bytes.append(reinterpret_cast<const char*>(&narrow), sizeof narrow);
  }
  return bytes;
}

constexpr std::size_t n = 500;

/// Unit quaternions within half a radian of each other, or directions.
std::vector<double> rows(std::size_t columns) {
  std::vector<double> numbers;
  std::uint64_t state = 1;
  for (std::size_t i = 0; i < n; ++i) {
    double square = 0;
    for (std::size_t c = 0; c < columns; ++c) {
      state = state * 6364136223846793005U + 1442695040888963407U;
      numbers.push_back(0.4 * (static_cast<double>(state >> 11) * 0x1p-53 - 0.5) + (c + 1 == columns ? 1 : 0));
      square += numbers.back() * numbers.back();
    }
    for (std::size_t c = 0; c < columns; ++c) numbers[i * columns + c] /= std::sqrt(square);
  }
  return numbers;
}
std::string csv(const std::vector<double>& numbers, std::size_t columns, std::size_t begin = 0, std::size_t end = n) {
  std::string text = columns == 4 ? "qx,qy,qz,qw\n" : "dx,dy,dz\n";
  for (std::size_t i = begin; i < end; ++i) {
    for (std::size_t c = 0; c < columns; ++c) {
      text += fmt::format("{:.17g}{}", numbers[i * columns + c], c + 1 < columns ? "," : "\n");
    }
  }
  return text;
}
std::string shapeOf(std::size_t columns) { return fmt::format("({}, {})", n, columns); }

nlohmann::json jsonOf(const ProgramOutput& output) {
  EXPECT_EQ(output.error, "");
  return nlohmann::json::parse(output.output);
}
/// The numbers of two lists of any depth, the largest difference.
double difference(const nlohmann::json& a, const nlohmann::json& b) {
  if (a.is_number()) return std::abs(a.get<double>() - b.get<double>());
  double largest = 0;
  if (a.is_object()) {
    for (const auto& [key, value] : a.items()) largest = std::max(largest, difference(value, b.at(key)));
  }
  for (std::size_t i = 0; a.is_array() && i < a.size(); ++i) largest = std::max(largest, difference(a[i], b[i]));
  return largest;
}

TEST(MeanOfArrays, isThatOfTheSameRowsAsTextAndInAStream) {
  const TemporaryDirectory directory;
  for (const std::size_t columns : {4U, 3U}) {
    const std::vector<double> numbers = rows(columns);
    const std::string text = directory.write("f.csv", csv(numbers, columns)),
                      array = directory.write("f.npy", npy("'<f8'", shapeOf(columns), bytesOf<double>(numbers))),
                      floats = directory.write("g.npy", npy("'<f4'", shapeOf(columns), bytesOf<float>(numbers)));
    const Words feature = columns == 3 ? Words{"--feature", "direction"} : Words{};
    const nlohmann::json known = jsonOf(run({"mean", text, "--json", "-"}));
    const nlohmann::json read = jsonOf(run(Words{"mean", array, "--json", "-"} + feature));
    for (const char* field : {"mean", "covariance", "dispersion", "verdict", "n"}) {
      EXPECT_EQ(read[field], known[field]) << field;
    }
    EXPECT_EQ(read["format"], "npy");
    const ProgramOutput streamed = run(Words{"mean", array, "--memory", "0", "--json", "-"} + feature);
    EXPECT_EQ(streamed.exit_code, 0);
    const nlohmann::json found = jsonOf(streamed);
    const char* const mean = columns == 4 ? "quaternion_xyzw" : "direction";
    EXPECT_LE(difference(found["mean"][mean], known["mean"][mean]), 1e-12);
    EXPECT_LE(difference(found["covariance"], known["covariance"]), 1e-14);
    EXPECT_LE(difference(found["dispersion"], known["dispersion"]), 1e-12);
    EXPECT_EQ(found["status"], "ok");
    EXPECT_EQ(found["unique"], "unique");
    const nlohmann::json of_floats = jsonOf(run(Words{"mean", floats, "--memory", "0", "--json", "-"} + feature));
    EXPECT_LE(difference(of_floats["mean"][mean], known["mean"][mean]), 1e-7);
    EXPECT_GT(difference(of_floats["mean"][mean], known["mean"][mean]), 0);
  }
}

TEST(MeanOfArrays, leavesBadRowsOutOfAStreamAndRefusesWhatIsNoArray) {
  const TemporaryDirectory directory;
  std::vector<double> numbers = rows(4);
  numbers[0] = 2;
  const std::string bad_row = directory.write("f.npy", npy("'<f8'", shapeOf(4), bytesOf<double>(numbers)));
  const ProgramOutput streamed = run({"mean", bad_row, "--memory", "0"});
  EXPECT_TRUE(contains(streamed.output, "1 row is not finite or not of unit norm")) << streamed.output;
  const auto complaint = [&](const std::string& file, const Words& more = {}) {
    const ProgramOutput output = run(Words{"mean", directory.write("x.npy", file)} + more);
    EXPECT_EQ(output.exit_code, 2) << output.output;
    return output.error;
  };
  const std::string good = npy("'<f8'", shapeOf(4), bytesOf<double>(rows(4)));
  EXPECT_TRUE(contains(run({"mean", bad_row}).error, "norm of the quaternion is 2"));
  EXPECT_TRUE(contains(complaint(good.substr(0, good.size() - 1)), "truncated"));
  EXPECT_TRUE(contains(complaint(good.substr(0, 40)), "ends within its header"));
  EXPECT_TRUE(contains(complaint(npy("'<f8'", shapeOf(4), bytesOf<double>(rows(4)), "True")), "ascontiguousarray"));
  EXPECT_TRUE(contains(complaint(npy("'>f8'", shapeOf(4), bytesOf<double>(rows(4)))), "big-endian"));
  EXPECT_TRUE(contains(complaint(npy("'|O'", shapeOf(4), "x")), "Python objects"));
  EXPECT_TRUE(contains(complaint(npy("[('x', '<f8')]", shapeOf(4), "x")), "numbers of the type"));
  EXPECT_TRUE(contains(complaint(npy("'<i8'", shapeOf(4), "x")), "doubles or floats"));
  EXPECT_TRUE(contains(complaint(npy("'<f8'", "(500,)", "x")), "shape (500,)"));
  EXPECT_TRUE(contains(complaint(npy("'<f8'", "(0, 4)", "")), "no rows"));
  EXPECT_TRUE(contains(complaint(npy("'<f8'", "(18446744073709551615, 4)", "x")), "truncated"));
  EXPECT_TRUE(contains(complaint(npy("'<f8'", shapeOf(5), bytesOf<double>(rows(5)))), "rows of 5 numbers"));
  EXPECT_TRUE(contains(complaint(npy("'<f8'", shapeOf(3), bytesOf<double>(rows(3)))), "--feature point"));
  EXPECT_TRUE(
      contains(complaint(npy("'<f8'", shapeOf(7), bytesOf<double>(rows(7))), {"--memory", "0"}), "have no states"));
  EXPECT_TRUE(
      contains(complaint(good, {"--memory", "0", "--report", directory / "r"}), "--report needs the measurements"));
}

/// Headings about north, every third with another weight.
std::string headings(bool weighted) {
  std::string text = weighted ? "heading_deg,weight\n" : "heading_deg\n";
  for (std::size_t i = 0; i < n; ++i) {
    const double angle = std::remainder(static_cast<double>(i * 7919 % 500) / 10 - 20, 360);
    text += fmt::format("{}{}\n", angle < 0 ? angle + 360 : angle, !weighted ? "" : i % 3 == 0 ? ",0.25" : ",3");
  }
  return text;
}

TEST(MeanOfText, inAStreamIsThatInMemory) {
  const TemporaryDirectory directory;
  std::string weighted;
  std::size_t row = 0;
  for (const char c : csv(rows(4), 4)) {
    weighted += c == '\n' ? (row++ == 0 ? ",weight\n" : row % 3 == 0 ? ",0.25\n" : ",3\n") : std::string(1, c);
  }
  for (const std::string& text :
       {csv(rows(4), 4), csv(rows(3), 3), weighted, headings(false), headings(true), csv(rows(4), 4) + "# end\n\n"}) {
    const std::string file = directory.write("f.csv", text);
    const nlohmann::json known = jsonOf(run({"mean", file, "--json", "-"}));
    const ProgramOutput streamed = run({"mean", file, "--memory", "0", "--json", "-"});
    ASSERT_EQ(streamed.exit_code, 0) << streamed.error << text.substr(0, 30);
    const nlohmann::json found = jsonOf(streamed);
    for (const char* field : {"feature", "criterion", "format", "n", "status", "unique"}) {
      EXPECT_EQ(found[field], known[field]) << field << " of " << text.substr(0, 30);
    }
    EXPECT_LE(difference(found["mean"], known["mean"]), 1e-10) << found["mean"] << known["mean"];
    EXPECT_LE(difference(found["covariance"], known["covariance"]), 1e-9 * known["covariance"][0][0].get<double>());
    EXPECT_LE(difference(found["dispersion"], known["dispersion"]), 1e-12);
    EXPECT_FALSE(known["covariance"].is_null());
  }
}

TEST(MeanOfText, streamsWhatHasAStateAndSaysWhatNeedsMemory) {
  const TemporaryDirectory directory;
  const auto complaint = [&](const std::string& text, const Words& more = {}) {
    const ProgramOutput output = run(Words{"mean", directory.write("f.csv", text), "--memory", "0"} + more);
    EXPECT_EQ(output.exit_code, 2) << output.output;
    return output.error;
  };
  EXPECT_TRUE(contains(complaint("x,y,z\n1,2,3\n"), "points have no states"));
  EXPECT_TRUE(contains(complaint("qx,qy,qz,qw,sd_0,sd_1,sd_2\n0,0,0,1,.1,.1,.1\n"), "need the measurements in memory"));
  EXPECT_TRUE(contains(complaint("heading_deg\n1\n", {"--criterion", "maha"}), "--criterion maha needs"));
  EXPECT_TRUE(contains(complaint("heading_deg\n1\n", {"--criterion", "wlsq"}), "needs a column weight"));
  EXPECT_TRUE(contains(complaint("heading_deg,weight\n1,0\n2,0\n"), "every weight is 0"));
  EXPECT_TRUE(contains(complaint(csv(rows(4), 4) + "1,0,0\n"), ":502: 3 fields"));
  EXPECT_TRUE(contains(complaint("heading_deg\n1\nnorth\n"), ":3: heading_deg is 'north', expected a number"));
  EXPECT_TRUE(contains(complaint("heading_deg,x,y,z\n1,0,0,0\n"), "the columns x,y,z and heading_deg"));
  EXPECT_TRUE(contains(complaint(csv(rows(4), 4), {"--feature", "heading"}), "does not fit a file of rotations"));
  EXPECT_TRUE(contains(run({"mean", directory.write("f.csv", headings(false)), "--report", directory / "r"}).error,
                       "headings are a circle"));
  const std::string array = directory.write("f.npy", npy("'<f8'", shapeOf(4), bytesOf<double>(rows(4))));
  EXPECT_TRUE(contains(run({"mean", array, "--memory", "0", "--criterion", "wlsq"}).error, "needs weights"));
}

TEST(MeanOfHeadings, isTheDirectionThatPeopleMean) {
  const TemporaryDirectory directory;
  const std::string file = directory.write("wind.csv", "heading_deg\n350\n355\n5\n10\n30\n");
  const nlohmann::json found = jsonOf(run({"mean", file, "--json", "-"}));
  EXPECT_NEAR(found["mean"]["heading_deg"].get<double>(), 6, 1e-12);
  EXPECT_EQ(found["feature"], "heading");
  EXPECT_EQ(found["covariance"].size(), 1U);
  const ProgramOutput shown = run({"mean", file});
  EXPECT_TRUE(contains(shown.output, "5 headings (csv)") && contains(shown.output, "heading")) << shown.output;
  // The state is the one that SQLite and Python make of the same column: docs/sqlite.md's example is 5.913.
  ASSERT_NE(run({"mean", file, "--state", directory / "s"}).exit_code, 2);
  EXPECT_TRUE(contains(run({"merge", directory / "s"}).output, "chordal mean 5.91"));
}

TEST(MeanState, mergesToTheMeanOfAllInAFewPasses) {
  const TemporaryDirectory directory;
  const std::vector<double> numbers = rows(4);
  const std::string whole = directory.write("whole.csv", csv(numbers, 4));
  std::vector<std::string> parts{directory.write("0.csv", csv(numbers, 4, 0, 100)),
                                 directory.write("1.csv", csv(numbers, 4, 100, 350)),
                                 directory.write("2.csv", csv(numbers, 4, 350, n))};
  const nlohmann::json known = jsonOf(run({"mean", whole, "--json", "-"}));
  std::string after;
  for (int pass = 1; pass < 6; ++pass) {
    const auto merged = [&](const std::vector<std::string>& files, const std::string& name) {
      Words merge{"merge", "--json", "-", "--out", directory / name};
      for (const std::string& file : files) {
        Words words{"mean", file, "--state", file + ".state"};
        if (!after.empty()) words = words + Words{"--after", after};
        EXPECT_NE(run(words).exit_code, 2);
        merge.push_back(file + ".state");
      }
      return jsonOf(run(merge));
    };
    const nlohmann::json found = merged(parts, "merged"), alone = merged({whole}, "alone");
    EXPECT_EQ(contentOf(directory / "merged"), contentOf(directory / "alone"));
    EXPECT_EQ(found["pass"], pass);
    EXPECT_EQ(found["n"], n);
    if (pass > 1 && !found["another_pass"].get<bool>()) {
      EXPECT_EQ(found["status"], "ok");
      EXPECT_LE(difference(found["mean"], known["mean"]["quaternion_xyzw"]), 1e-12);
      EXPECT_LE(pass, 4);
      const ProgramOutput shown = run({"merge", directory / "merged"});
      EXPECT_EQ(shown.exit_code, 0);
      EXPECT_TRUE(contains(shown.output, "Fréchet mean") && !contains(shown.output, "next")) << shown.output;
      break;
    }
    ASSERT_LT(pass, 5);
    const ProgramOutput shown = run({"merge", directory / "merged"});
    EXPECT_TRUE(contains(shown.output, fmt::format("next         pass {}", pass + 1))) << shown.output;
    after = directory / fmt::format("pass{}", pass);
    std::filesystem::rename(directory / "merged", after);
    std::reverse(parts.begin(), parts.end());
  }
}

TEST(MeanState, refusesWhatIsNoStateOrDoesNotFit) {
  const TemporaryDirectory directory;
  const std::string file = directory.write("f.csv", csv(rows(4), 4)),
                    directions = directory.write("d.csv", csv(rows(3), 3));
  ASSERT_EQ(run({"mean", file, "--state", directory / "a"}).exit_code, 0);
  ASSERT_EQ(run({"mean", directions, "--state", directory / "d"}).exit_code, 0);
  const auto complaint = [&](const Words& words) {
    const ProgramOutput output = run(words);
    EXPECT_EQ(output.exit_code, 2) << output.output;
    return output.error;
  };
  std::string newer = contentOf(directory / "a"), damaged = newer;
  newer[7] = 2, damaged[20] = 1;
  EXPECT_TRUE(contains(complaint({"merge", directory.write("newer", newer)}), "newer version"));
  EXPECT_TRUE(contains(complaint({"merge", directory.write("bad", damaged)}), "damaged"));
  EXPECT_TRUE(contains(complaint({"merge", file}), "not the bytes of a state"));
  EXPECT_TRUE(contains(complaint({"merge", directory / "a", directory / "d"}), "do not merge"));
  EXPECT_TRUE(contains(complaint({"mean", file, "--after", directory / "a"}), "--after without --state"));
  EXPECT_TRUE(contains(complaint({"mean", file, "--state", directory / "x", "--after", directory / "d"}),
                       "a state of directions"));
  EXPECT_TRUE(contains(complaint({"mean", file, "--state", directory / "no/x"}), "no"));
  const std::string points = directory.write("p.csv", "x,y,z\n1,2,3\n"),
                    weights = directory.write("w.csv", "qx,qy,qz,qw,weight\n0,0,0,1,3\n0,0.6,0,0.8,1\n");
  EXPECT_TRUE(contains(complaint({"mean", points, "--state", directory / "x"}), "points have no states"));
  EXPECT_TRUE(contains(complaint({"mean", weights, "--state", directory / "x"}), "a weight is"));
  EXPECT_NE(run({"mean", weights, "--state", directory / "x", "--largest-weight", "4"}).exit_code, 2);
}

}  // namespace
}  // namespace liestat::cli
