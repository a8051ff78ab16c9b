// Maps of orientations: .ang and .ctf, phases, points that were not indexed, and files that are none.

#include <formats/ebsd.hpp>
#include <formats/input_error.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include <support/temporary_directory.hpp>

namespace {

using namespace liestat;

constexpr double pi = 3.14159265358979323846;

const std::string ang_header =
    "# TEM_PIXperUM          1.000000\n"
    "# Phase 1\n# MaterialName  \tNickel\n# Formula     \tNi\n# Symmetry              43\n"
    "# Phase 2\n# MaterialName  \tTitanium (Alpha)\n# Symmetry              62\n"
    "# Phase 3\n# MaterialName  \tOdd\n# Symmetry              20\n"
    "# GRID: SqrGrid\n# NCOLS_ODD: 2\n#\n";

const std::string ctf_header =
    "Channel Text File\r\nPrj\tunnamed\r\nJobMode\tGrid\r\nXCells\t2\r\n"
    "Euler angles refer to Sample Coordinate system (CS0)!\tMag\t100\r\nPhases\t2\r\n"
    "3.524;3.524;3.524\t90;90;90\tNi-superalloy\t11\t225\r\n"
    "4.913;4.913;5.504\t90;90;120\tQuartz low\t7\t152\r\n"
    "Phase\tX\tY\tBands\tError\tEuler1\tEuler2\tEuler3\tMAD\tBC\tBS\r\n";

std::string errorOf(const std::string& path) {
  try {
    readEbsdFile(path);
  } catch (const InputError& error) {
    return error.what();
  }
  return "";
}

TEST(Ebsd, ang) {
  const TemporaryDirectory directory;
  const std::string rows =
      " 0.40000 1.10000 5.90000 0.0 0.0 50.0 0.900 1 1 1.2\n"
      "12.56637 12.56637 12.56637 1.0 0.0 5.0 -1.000 0 1 1.2\n"
      " 1.00000 0.50000 0.20000 2.0 0.0 50.0 0.500 2 1 1.2\n"
      " 1.00000 0.50000 0.20000 2.0 0.0 50.0 -1.000 2 1 1.2\n"
      " 1.00000 0.70000 0.20000 2.0 0.0 50.0 0.000 1 1 1.2\n";
  const EbsdFile map = readEbsdFile(directory.write("map.ang", ang_header + rows));
  ASSERT_EQ(map.phases.size(), 3U);
  EXPECT_EQ(map.phases[0].name, "Nickel");
  EXPECT_EQ(map.phases[0].symmetry, "m-3m");
  EXPECT_EQ(map.phases[0].group->name(), "432");
  EXPECT_EQ(map.phases[0].n, 2U);
  EXPECT_EQ(map.phases[1].name, "Titanium (Alpha)");
  EXPECT_EQ(map.phases[1].group->name(), "622");
  EXPECT_EQ(map.phases[1].n, 1U);
  EXPECT_FALSE(map.phases[2].group);
  EXPECT_EQ(map.phases[2].symmetry, "code 20");
  EXPECT_EQ(map.n_unindexed, 2U);
  EXPECT_EQ(map.axes(), HexagonalAxes::x_along_a);
  const auto nickel = map.orientationsOf(map.phases[0]);
  ASSERT_EQ(nickel.size(), 2U);
  const auto expected = CrystalOrientation::fromBunge(0.4, 1.1, 5.9, *PointGroup::fromName("432"));
  EXPECT_LT(distance(nickel[0], expected), 1e-12);
  EXPECT_LT((nickel[0].rotation().matrix() - expected.rotation().matrix()).norm(), 1e-12);
  EXPECT_EQ(map.lines[0], 15U);
}

TEST(Ebsd, angOfOnePhaseMayCallItZero) {
  const TemporaryDirectory directory;
  const EbsdFile map = readEbsdFile(
      directory.write("m.ANG", "# Phase 1\n# MaterialName Iron\n# Symmetry 43\n0.1 0.2 0.3 0 0 1 0.5 0 1 1\n"));
  EXPECT_EQ(map.phases[0].n, 1U);
}

TEST(Ebsd, ctf) {
  const TemporaryDirectory directory;
  const std::string rows =
      "1\t0.0\t0.0\t8\t0\t45.0\t30.0\t10.0\t0.5\t120\t200\r\n"
      "0\t1.0\t0.0\t0\t3\t0.0\t0.0\t0.0\t0.0\t60\t0\r\n"
      "2\t2.0\t0.0\t7\t0\t90,5\t30,25\t300,0\t0,5\t120\t200\r\n";
  const EbsdFile map = readEbsdFile(directory.write("map.ctf", ctf_header + rows));
  ASSERT_EQ(map.phases.size(), 2U);
  EXPECT_EQ(map.phases[0].name, "Ni-superalloy");
  EXPECT_EQ(map.phases[0].group->name(), "432");
  EXPECT_EQ(map.phases[1].name, "Quartz low");
  EXPECT_EQ(map.phases[1].symmetry, "-3m");
  // Its x axis is along a*.
  EXPECT_EQ(map.phases[1].group->name(), "312");
  EXPECT_EQ(map.n_unindexed, 1U);
  const auto quartz = map.orientationsOf(map.phases[1]);
  ASSERT_EQ(quartz.size(), 1U);
  EXPECT_LT(distance(quartz[0], CrystalOrientation::fromBunge(90.5 * pi / 180, 30.25 * pi / 180, 300 * pi / 180,
                                                              *map.phases[1].group)),
            1e-12);
}

TEST(Ebsd, errorsNameLineAndValue) {
  const TemporaryDirectory directory;
  const auto ang = [&](const std::string& text) { return errorOf(directory.write("e.ang", text)); };
  const auto ctf = [&](const std::string& text) { return errorOf(directory.write("e.ctf", text)); };
  EXPECT_NE(ang(ang_header + "0.1 0.2 0.3 0 0\n").find(":15: 5 columns"), std::string::npos);
  EXPECT_NE(ang(ang_header + "0.1 zwei 0.3 0 0 1 0.5 1\n").find("'zwei'"), std::string::npos);
  EXPECT_NE(ang(ang_header + "45 30 10 0 0 1 0.5 1\n").find(":15: an angle of 45, expected rad"), std::string::npos);
  EXPECT_NE(ang(ang_header + "0.1 0.2 0.3 0 0 1 0.5 7\n").find(":15: phase 7"), std::string::npos);
  EXPECT_NE(ang(ang_header + "0.1 0.2 0.3 0 0 1 0.5 1.5\n").find("phase is 1.5"), std::string::npos);
  EXPECT_NE(ang(ang_header + "0.1 0.2 0.3 0 0 1 -1 1\n").find("no point was indexed, 1 were not"), std::string::npos);
  EXPECT_NE(ctf("Channel Text File\n").find("no header of the columns"), std::string::npos);
  EXPECT_NE(ctf(ctf_header + "1\t0\t0\n").find(":10: 3 columns"), std::string::npos);
  EXPECT_NE(ctf("Phases\t1\na\tb\n").find(":2: 2 fields of a phase"), std::string::npos);
  EXPECT_NE(ctf("Phases\t0\nPhase\tX\tY\n").find("no column Euler1"), std::string::npos);
  EXPECT_NE(errorOf(directory.write("e.txt", "")).find("*.ang or *.ctf"), std::string::npos);
  EXPECT_FALSE(isEbsdName("ang"));
}

}  // namespace
