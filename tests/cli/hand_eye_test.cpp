// `liestat hand-eye` and `liestat simulate hand-eye`: files in, answer, JSON, page and hints out.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include <cli/program_output.hpp>
#include <support/temporary_directory.hpp>

namespace liestat::cli {
namespace {

using Json = nlohmann::json;

/// A simulated calibration: the files of poses and the truth.
struct Scene {
  TemporaryDirectory directory;
  Json truth;
  std::string a, b;

  explicit Scene(const Words& options, bool tum = false) {
    Words words{"simulate", "hand-eye", "--output", directory / "scene"};
    if (tum) words.insert(words.end(), {"--format", "tum"});
    words.insert(words.end(), options.begin(), options.end());
    const ProgramOutput made = run(words);
    EXPECT_EQ(made.exit_code, 0) << made.error;
    a = directory / (tum ? "scene/a.txt" : "scene/a.csv"), b = directory / (tum ? "scene/b.txt" : "scene/b.csv");
    EXPECT_TRUE(contains(made.output, "liestat hand-eye " + a + " " + b)) << made.output;
    truth = Json::parse(contentOf(directory / "scene/truth.json"));
  }
  ProgramOutput calibrated(const Words& options) const { return run(Words{"hand-eye", a, b} + options); }
  Json json(int exit_code, Words options = {}) const {
    options.insert(options.end(), {"--json", "-"});
    const ProgramOutput out = calibrated(options);
    EXPECT_EQ(out.exit_code, exit_code) << out.error << out.output;
    return Json::parse(out.output);
  }
};

/// Expects each coordinate within five standard deviations of the truth; in one estimate one of the six is
/// beyond with a probability of 3e-6.
void expectTruth(const Json& found, const Json& truth) {
  for (int i = 0; i < 3; ++i) {
    const double translation = found["standard_deviations"]["translation_m"][i];
    EXPECT_NEAR(found["translation"][i], truth["translation"][i], 5 * translation);
    const double rotation = found["standard_deviations"]["rotation_vector_deg"][i].get<double>() * M_PI / 180;
    EXPECT_NEAR(found["rotation_vector"][i], truth["rotation_vector"][i], 5 * rotation);
    EXPECT_GT(translation, 1e-5);
    EXPECT_LT(translation, 0.02);
    EXPECT_GT(rotation, 1e-5);
    EXPECT_LT(rotation, 0.02);
  }
}

TEST(HandEyeCommand, findsWhatWasSimulated) {
  const Scene scene({"--seed", "3", "--noise", "anisotropic"});
  const Json json = scene.json(0);
  EXPECT_EQ(json["status"], "ok");
  EXPECT_EQ(json["problem"], "AX = YB");
  EXPECT_EQ(json["noise"], "given");
  EXPECT_EQ(json["association"], "time");
  expectTruth(json["X"], scene.truth["X"]), expectTruth(json["Y"], scene.truth["Y"]);
  EXPECT_EQ(json["X"]["covariance"].size(), 6U);
  EXPECT_EQ(json["joint_covariance"].size(), 12U);
  EXPECT_EQ(json["degrees_of_freedom"], 6 * 20 - 12);
  EXPECT_GT(json["p"], 1e-3);
  EXPECT_EQ(json["pairs"].size(), 20U);
  EXPECT_TRUE(json["outliers"].empty());
  EXPECT_TRUE(json["open_directions"].empty());
  EXPECT_TRUE(json["hints"].empty());
  EXPECT_EQ(json["pairs"][4]["row_a"], 5);
  EXPECT_EQ(json["pairs"][4]["line_b"], 6);

  const ProgramOutput out = scene.calibrated({});
  EXPECT_EQ(out.exit_code, 0);
  EXPECT_EQ(out.output.rfind("ok: X and Y are determined\n", 0), 0U) << out.output;
  EXPECT_TRUE(contains(out.output, "20 of 20 pairs used"));
  std::istringstream lines(out.output);
  for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), 120U) << line;
}

TEST(HandEyeCommand, independentMotions) {
  const Scene scene({"--relative", "--seed", "5"});
  const Json json = scene.json(0, {"--relative"});
  EXPECT_EQ(json["problem"], "AX = XB");
  expectTruth(json["X"], scene.truth["X"]);
  EXPECT_TRUE(json["Y"].is_null());
  EXPECT_EQ(json["degrees_of_freedom"], 6 * 20 - 6);
}

TEST(HandEyeCommand, withoutCovariancesTheNoiseIsFound) {
  const Scene scene({"--seed", "4"}, true);
  const Json json = scene.json(0);
  EXPECT_EQ(json["noise"], "scaled");
  EXPECT_TRUE(json["p"].is_null());
  // Twice the rotation's standard deviation that is assumed, and the translation's as it is.
  EXPECT_GT(json["variance_factor"], 1.2);
  EXPECT_LT(json["variance_factor"], 4.2);
  expectTruth(json["X"], scene.truth["X"]);
  EXPECT_TRUE(contains(scene.calibrated({}).output, "the noise is not known"));

  const Json given = scene.json(0, {"--sigma-a", "0.2,0.001", "--sigma-b", "0.2,0.2,0.2,0.001,0.001,0.001"});
  EXPECT_EQ(given["noise"], "given");
  EXPECT_GT(given["p"], 1e-3);
  EXPECT_EQ(given["A"]["noise"], "option");
  expectTruth(given["X"], scene.truth["X"]);
}

TEST(HandEyeCommand, exactPosesOfOneFile) {
  const Scene scene({"--seed", "6"}, true);
  // All of the noise in B: larger than what it has.
  EXPECT_EQ(scene.json(0, {"--sigma-a", "0,0", "--sigma-b", "0.3,0.003"})["status"], "ok");
  const ProgramOutput out = scene.calibrated({"--sigma-a", "0,0", "--sigma-b", "0,0"});
  EXPECT_EQ(out.exit_code, 2);
  EXPECT_TRUE(contains(out.error, "exact")) << out.error;
}

TEST(HandEyeCommand, theFilesMayHoldInversePoses) {
  const Scene scene({"--seed", "7"});
  const Json json = scene.json(0);
  // The inverses of X and Y, in exchange: A⁻¹ Y = X B⁻¹.
  const Json inverse = scene.json(0, {"--invert-a", "--invert-b"});
  EXPECT_NEAR(inverse["chi2"].get<double>() / json["chi2"].get<double>(), 1, 1e-6);
  for (int i = 0; i < 3; ++i) {
    EXPECT_NEAR(inverse["X"]["translation"][i], json["Y"]["translation"][i], 1e-6);
    EXPECT_NEAR(inverse["Y"]["rotation_vector"][i], json["X"]["rotation_vector"][i], 1e-6);
    for (int j = 0; j < 6; ++j) {
      EXPECT_NEAR(inverse["X"]["covariance"][i][j], json["Y"]["covariance"][i][j], 1e-9);
    }
  }
  // One of the two is wrong; which one can't be known.
  const Json wrong = scene.json(3, {"--invert-a"});
  ASSERT_EQ(wrong["hints"].size(), 1U) << wrong["status"] << wrong["chi2"];
  EXPECT_TRUE(wrong["hints"][0]["one_file_inverted"]);
  EXPECT_TRUE(wrong["hints"][0]["agrees"]);
  EXPECT_TRUE(contains(wrong["hints"][0]["text"], "without --invert-a")) << wrong["hints"][0]["text"];
}

TEST(HandEyeCommand, inversePosesAreNamedWhereTheNoiseIsNotKnown) {
  const Scene scene({"--seed", "8"}, true);
  const ProgramOutput out = scene.calibrated({"--invert-b"});
  EXPECT_TRUE(contains(out.output, "without --invert-b")) << out.output;
}

TEST(HandEyeCommand, directionsThatAreOpenAreNamed) {
  const Scene planar({"--motion", "planar", "--seed", "2"});
  const Json json = planar.json(3);
  EXPECT_EQ(json["status"], "undetermined");
  ASSERT_EQ(json["open_directions"].size(), 1U);
  const Json& open = json["open_directions"][0];
  EXPECT_FALSE(open["rotates"]);
  EXPECT_TRUE(contains(open["description"], "translation along the rotation axis (")) << open["description"];
  EXPECT_LT(open["excitation"], 10);
  EXPECT_FALSE(json["X"]["covariance"].is_null());
  std::size_t open_coordinates = 0;
  for (const Json& sigma : json["X"]["standard_deviations"]["translation_m"])
    open_coordinates += sigma.is_null() ? 1 : 0;
  EXPECT_GE(open_coordinates, 1U);
  for (const Json& sigma : json["X"]["standard_deviations"]["rotation_vector_deg"]) EXPECT_FALSE(sigma.is_null());
  const ProgramOutput out = planar.calibrated({});
  EXPECT_EQ(out.output.rfind("NOT TO BE TRUSTED (undetermined)", 0), 0U) << out.output;
  EXPECT_TRUE(contains(out.output, "translation along the rotation axis ("));

  const Json one_axis = Scene({"--motion", "one_axis", "--seed", "2"}).json(3);
  EXPECT_EQ(one_axis["open_directions"].size(), 2U);
  EXPECT_TRUE(one_axis["X"]["covariance"].is_null());
  EXPECT_TRUE(one_axis["X"]["standard_deviations"]["translation_m"][0].is_null());
}

TEST(HandEyeCommand, wrongPairsAreFound) {
  const Scene scene({"--pairs", "30", "--outliers", "0.3", "--outlier-kind", "flips", "--seed", "9"});
  const Json json = scene.json(0);
  std::vector<std::size_t> wrong;
  for (std::size_t i = 0; i < 30; ++i) {
    if (scene.truth["inlier"][i] == 0) wrong.push_back(i);
  }
  // Those that are flipped by a few degrees are no wrong pairs.
  ASSERT_GE(wrong.size(), 6U);
  EXPECT_EQ(json["outliers"].get<std::vector<std::size_t>>(), wrong);
  EXPECT_FALSE(json["pairs"][wrong[0]]["inlier"]);
  expectTruth(json["X"], scene.truth["X"]);
  const std::string row = std::to_string(wrong[0] + 1), line = std::to_string(wrong[0] + 2);
  const ProgramOutput out = scene.calibrated({});
  EXPECT_TRUE(contains(out.output, "row " + row + " (line " + line + ", ")) << out.output;
  EXPECT_EQ(scene.json(3, {"--keep-outliers"})["status"], "inconsistent");
}

/// A CSV file as a header and rows of fields.
std::vector<Words> rowsOf(const std::string& path) {
  std::vector<Words> rows;
  std::istringstream lines(contentOf(path));
  for (std::string line; std::getline(lines, line);) {
    std::istringstream fields(line);
    rows.emplace_back();
    for (std::string field; std::getline(fields, field, ',');) rows.back().push_back(field);
  }
  return rows;
}
std::string textOf(const std::vector<Words>& rows) {
  std::string text;
  for (const Words& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) text += (i > 0 ? "," : "") + row[i];
    text += "\n";
  }
  return text;
}

TEST(HandEyeCommand, theOrderOfRowsDoesNotMatter) {
  const Scene scene({"--seed", "10", "--outliers", "0.2"});
  const auto shuffled = [&](const std::string& path, const std::string& name, std::size_t stride) {
    const std::vector<Words> rows = rowsOf(path);
    std::vector<Words> others{rows[0]};
    for (std::size_t i = 0; i < 20; ++i) others.push_back(rows[1 + (stride * i + 5) % 20]);
    return scene.directory.write(name, textOf(others));
  };
  // By time: each file in an order of its own.
  const ProgramOutput first = scene.calibrated({"--json", "-"});
  const ProgramOutput second =
      run({"hand-eye", shuffled(scene.a, "a.csv", 7), shuffled(scene.b, "b.csv", 3), "--json", "-"});
  Json x = Json::parse(first.output), y = Json::parse(second.output);
  for (Json* json : {&x, &y}) {
    json->erase("command_line"), (*json)["A"].erase("file"), (*json)["B"].erase("file");
    for (Json& pair : (*json)["pairs"]) {
      for (const char* place : {"row_a", "row_b", "line_a", "line_b"}) pair.erase(place);
    }
  }
  EXPECT_EQ(x.dump(), y.dump()) << "the same bytes";
  EXPECT_EQ(x["outliers"].size(), 4U);
  // By row: both in the same order.
  const ProgramOutput third =
      run({"hand-eye", shuffled(scene.a, "a.csv", 7), shuffled(scene.b, "b.csv", 7), "--by-row", "--json", "-"});
  const Json z = Json::parse(third.output);
  EXPECT_EQ(z["association"], "row");
  for (const char* field : {"X", "Y", "joint_covariance", "chi2", "excitations"}) {
    EXPECT_EQ(x[field].dump(), z[field].dump()) << field;
  }
}

TEST(HandEyeCommand, timesAreMatched) {
  const Scene scene({"--seed", "11"});
  std::vector<Words> b = rowsOf(scene.b);
  // A clock that lags by 4 ms, an image between two poses, and one row less.
  for (std::size_t i = 1; i < b.size(); ++i) b[i][0] += ".004";
  b[3][0] = "2.5";
  b.erase(b.begin() + 8);
  const std::string other = scene.directory.write("b.csv", textOf(b));
  const ProgramOutput out = run({"hand-eye", scene.a, other, "--json", "-"});
  ASSERT_EQ(out.exit_code, 0) << out.error;
  const Json json = Json::parse(out.output);
  EXPECT_EQ(json["pairs"].size(), 18U);
  EXPECT_EQ(json["A"]["unmatched"], 2);
  EXPECT_EQ(json["B"]["unmatched"], 1);
  EXPECT_NEAR(json["largest_gap"], 0.004, 1e-9);
  EXPECT_TRUE(contains(run({"hand-eye", scene.a, other}).output, "without a partner: 2 of 20 rows of A, 1 of 19 of B"));
  const ProgramOutput strict = run({"hand-eye", scene.a, other, "--tolerance", "0.001"});
  EXPECT_EQ(strict.exit_code, 2);
  EXPECT_TRUE(contains(strict.error, "0 pairs with times within 0.001 s")) << strict.error;
  EXPECT_TRUE(contains(strict.error, "--tolerance")) << strict.error;
}

/// The covariances of a file of poses as another convention writes them: a reading that the library undoes.
using Square = std::vector<std::vector<double>>;
Square times(const Square& x, const Square& y) {
  Square z(6, std::vector<double>(6, 0));
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = 0; j < 6; ++j) {
      for (std::size_t k = 0; k < 6; ++k) z[i][j] += x[i][k] * y[k][j];
    }
  }
  return z;
}
Square transposed(const Square& x) {
  Square z = x;
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = 0; j < 6; ++j) z[i][j] = x[j][i];
  }
  return z;
}
/// Ad of a row's pose [[R, t^ R], [0, R]], written out once more; or what turns both parts to the axes of the world.
Square adjoint(const Words& row, bool lever) {
  double q[4], t[3];
  for (std::size_t i = 0; i < 3; ++i) t[i] = std::stod(row[1 + i]);
  for (std::size_t i = 0; i < 4; ++i) q[i] = std::stod(row[4 + i]);
  const double x = q[0], y = q[1], z = q[2], w = q[3];
  const double R[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                          {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                          {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
  const double hat[3][3] = {{0, -t[2], t[1]}, {t[2], 0, -t[0]}, {-t[1], t[0], 0}};
  Square Ad(6, std::vector<double>(6, 0));
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      Ad[i][j] = Ad[i + 3][j + 3] = R[i][j];
      for (std::size_t k = 0; lever && k < 3; ++k) Ad[i][j + 3] += hat[i][k] * R[k][j];
    }
  }
  return Ad;
}
template <class Change>
std::string withCovariances(const std::string& path, Change&& change) {
  std::vector<Words> rows = rowsOf(path);
  for (std::size_t r = 1; r < rows.size(); ++r) {
    Square V(6, std::vector<double>(6, 0));
    std::size_t column = 8;
    for (std::size_t i = 0; i < 6; ++i) {
      for (std::size_t j = i; j < 6; ++j) V[i][j] = V[j][i] = std::stod(rows[r][column++]);
    }
    const Square W = change(rows[r], V);
    column = 8;
    for (std::size_t i = 0; i < 6; ++i) {
      for (std::size_t j = i; j < 6; ++j) {
        std::ostringstream number;
        number.precision(17);
        number << W[i][j];
        rows[r][column++] = number.str();
      }
    }
  }
  return textOf(rows);
}
const auto left = [](const Words& row, const Square& V) {
  const Square Ad = adjoint(row, true);
  return times(times(Ad, V), transposed(Ad));
};
const auto along_world = [](const Words& row, const Square& V) {
  const Square R = adjoint(row, false);
  return times(times(R, V), transposed(R));
};
const auto rotation_first = [](const Words&, const Square& V) {
  Square W = V;
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = 0; j < 6; ++j) W[i][j] = V[(i + 3) % 6][(j + 3) % 6];
  }
  return W;
};

/// The hint of a calibration from one of the files with covariances of another convention.
template <class Change>
Json hintFor(const Scene& scene, bool in_a, Change&& change) {
  const std::string other = scene.directory.write("other.csv", withCovariances(in_a ? scene.a : scene.b, change));
  const ProgramOutput out = run({"hand-eye", in_a ? other : scene.a, in_a ? scene.b : other, "--json", "-"});
  EXPECT_EQ(out.exit_code, 3) << out.error;
  const Json json = Json::parse(out.output);
  EXPECT_EQ(json["hints"].size(), 1U) << json["status"] << " chi2 " << json["chi2"];
  return json["hints"].empty() ? Json({{"text", ""}, {"covariance_a", ""}, {"covariance_b", ""}}) : json["hints"][0];
}

TEST(HandEyeCommand, theConventionOfCovariancesIsNamed) {
  const Scene scene({"--seed", "12", "--pairs", "30", "--noise", "target"});
  const Json inverse = hintFor(scene, false, left);
  EXPECT_EQ(inverse["covariance_b"], "left");
  EXPECT_EQ(inverse["covariance_a"], "right");
  EXPECT_TRUE(contains(inverse["text"], "with the covariances of B read as those of camera_T_target")) << inverse;
  EXPECT_TRUE(contains(inverse["text"], "the residuals agree (chi2/dof ")) << inverse;
  EXPECT_GT(inverse["p"], 1e-3);
  EXPECT_EQ(hintFor(scene, false, rotation_first)["covariance_b"], "rotation_first");
}

TEST(HandEyeCommand, theConventionOfCovariancesOfAIsNamed) {
  // The noise of A is much less than that of B there: exchanged files make it the larger one.
  Scene scene({"--seed", "13", "--pairs", "30", "--noise", "target"});
  std::swap(scene.a, scene.b);
  EXPECT_EQ(hintFor(scene, true, rotation_first)["covariance_a"], "rotation_first");
}

TEST(HandEyeCommand, covariancesAlongTheWorldAreNamed) {
  const Scene scene({"--seed", "14", "--pairs", "40", "--noise", "target"});
  EXPECT_EQ(hintFor(scene, false, along_world)["covariance_b"], "world_axes");
}

TEST(HandEyeCommand, thePageHasResidualsExcitationAndCovariance) {
  const Scene scene({"--seed", "15", "--outliers", "0.2"});
  const ProgramOutput out = scene.calibrated({"--report", scene.directory / "page"});
  ASSERT_EQ(out.exit_code, 0) << out.error;
  const std::string page = contentOf(scene.directory / "page/index.html");
  for (const char* part : {"residuals.csv", "excitation.csv", "translation_covariance.csv", "rotation_covariance.csv",
                           "X = gripper_T_camera", "Y = base_T_target", "wrong"}) {
    EXPECT_TRUE(contains(page, part)) << part;
  }
  // A direction that is open has no ellipse.
  const Scene planar({"--motion", "one_axis", "--seed", "2"});
  EXPECT_EQ(planar.calibrated({"--report", planar.directory / "page"}).exit_code, 3);
  EXPECT_TRUE(contains(contentOf(planar.directory / "page/index.html"), "X has no covariance"));
}

TEST(SimulateHandEye, sameSeedSameFiles) {
  const Scene scene({"--seed", "16"}), same({"--seed", "16"}), other({"--seed", "17"});
  EXPECT_EQ(contentOf(scene.a), contentOf(same.a));
  EXPECT_EQ(contentOf(scene.b), contentOf(same.b));
  EXPECT_NE(contentOf(scene.a), contentOf(other.a));
  const ProgramOutput again = run({"simulate", "hand-eye", "--output", scene.directory / "scene"});
  EXPECT_EQ(again.exit_code, 2) << "a file is not replaced";
  EXPECT_TRUE(contains(again.error, "--overwrite"));
  EXPECT_EQ(run({"simulate", "hand-eye", "--output", scene.directory / "scene", "--overwrite"}).exit_code, 0);
}

TEST(HandEyeCommand, badInputIsNamed) {
  const TemporaryDirectory directory;
  const std::string header = "t,tx,ty,tz,rx,ry,rz\n";
  const std::string fine = header + "0,0,0,0,0,0,0\n1,1,0,0,1,0,0\n2,0,1,0,0,1,0\n3,0,1,1,0,1,1\n";
  const auto error = [&](const std::string& a, const std::string& b, const Words& more = {}) {
    const ProgramOutput out = run(Words{"hand-eye", directory.write("a.csv", a), directory.write("b.csv", b)} + more);
    EXPECT_EQ(out.exit_code, 2) << a << b;
    EXPECT_EQ(std::count(out.error.begin(), out.error.end(), '\n'), 1) << out.error;
    return out.error;
  };
  const auto expect = [&](const std::string& text, const Words& parts) {
    for (const std::string& part : parts) EXPECT_TRUE(contains(text, part)) << part << " is not in " << text;
  };
  const std::string two = header + "0,0,0,0,0,0,0\n1,1,0,0,1,0,0\n";
  expect(error(two, two, {"--by-row"}), {"a.csv", "2 poses", "b.csv", "at least 3"});
  expect(error(two, fine), {"a.csv", "2 pairs with times within 0.01 s", "2 poses", "4 poses in", "at least 3"});
  expect(error(fine, two, {"--by-row"}), {"4 poses in", "a.csv", "2 poses in", "b.csv", "as many in each"});
  expect(error(fine, header + "10,0,0,0,0,0,0\n11,1,0,0,1,0,0\n12,0,1,0,0,1,0\n"),
         {"a.csv: its times, 0 to 3 s, do not overlap those of", "b.csv, 10 to 12 s", "--by-row"});
  expect(error(fine, header + "0,0,0,0,0,0,0\n1,1,0,0,1,0,0\n1,0,1,0,0,1,0\n"),
         {"b.csv:4: the time 1 stands in line 3"});
  const std::string same = header + "0,1,0,0,1,0,0\n1,1,0,0,1,0,0\n2,1,0,0,1,0,0\n3,1,0,0,1,0,0\n";
  expect(error(same, fine), {"a.csv: all 4 poses are the same", "at least three different ones"});
  expect(error(fine, same), {"b.csv: all 4 poses are the same"});
  expect(error(header + "0,0,0,nan,0,0,0\n", fine), {"a.csv:2: tz", "finite"});
  expect(error("x,y,z\n1,2,3\n", fine), {"a.csv:2: the file has points", "poses"});
  expect(error(fine, "rx,ry,rz\n1,2,3\n"), {"b.csv:2: the file has rotations", "poses"});
  std::string covariances = "tx,ty,tz,rx,ry,rz", row = "\n0,0,0,0,0,0";
  for (int i = 0; i < 6; ++i) {
    for (int j = i; j < 6; ++j) {
      covariances += ",cov_" + std::to_string(i) + std::to_string(j);
      row += i == j ? (i == 5 ? ",-2" : ",1") : ",0";
    }
  }
  expect(error(covariances + row + "\n", fine), {"a.csv:2: the covariance is not positive definite"});
  row.replace(row.size() - 2, 2, "-1");
  expect(error(covariances + row + "\n", fine), {"a.csv:2: a variance of -1", "the rotation was not measured"});
  row.replace(row.size() - 2, 2, "1");
  const std::string with = covariances + row + row + row + row + "\n";
  expect(error(fine, with, {"--sigma-b", "1,1"}), {"b.csv: the file has covariances, and --sigma-b is given"});
  expect(error(fine, fine, {"--sigma-a", "1,1,1"}), {"--sigma-a has 3 values", "ROT,TRANS"});
  expect(error(fine, fine, {"--sigma-a", "0,1", "--sigma-b", "0,1"}), {"a.csv:2", "b.csv:2 are singular together"});
  expect(error(fine, fine, {"--tolerance", "-1"}), {"tolerance"});
  EXPECT_EQ(run({"hand-eye", directory / "none.csv", directory / "a.csv"}).exit_code, 2);
}

}  // namespace
}  // namespace liestat::cli
