#include <report/describe.hpp>
#include <stats/verdict.hpp>
#include <stats/words.hpp>
#include <lie/linear.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

namespace liestat {
namespace {

struct Inner {
  double ratio = 1.5;
  bool ok = true;
};
template <class V>
void describe(V& v, const Inner& x) {
  v("ratio", x.ratio, "1 expected")("ok", x.ok);
}
struct Outer {
  std::vector<Inner> parts;
  std::optional<Inner> best;
  std::optional<double> p;
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();
  std::string word = "a";
};
template <class V>
void describe(V& v, const Outer& x) {
  v("parts", x.parts, "of the whole")("best", x.best)("p", x.p)("axis", x.axis, "", "m")("word", x.word);
}

std::vector<std::string> pathsOf(const auto& fields) {
  std::vector<std::string> paths;
  for (const FieldDescription& f : fields) paths.push_back(f.path);
  return paths;
}

TEST(Describe, FieldsAreListedWhetherTheyHaveValuesOrNot) {
  static_assert(Described<Outer> && Described<Verdict> && !Described<double>);
  const std::vector<std::string> expected{"parts[]", "parts[].ratio", "parts[].ok", "best", "best.ratio", "best.ok",
                                          "p",       "axis",          "word"};
  EXPECT_EQ(pathsOf(fieldsOf<Outer>()), expected);
  Outer full;
  full.parts.resize(2), full.best = Inner{}, full.p = 0.5;
  EXPECT_EQ(pathsOf(fieldsOf(full)), expected);
  EXPECT_EQ(fieldsOf(full).front().meaning, "of the whole");
  EXPECT_EQ(fieldsOf(full)[7].unit, "m");
}

TEST(Describe, FiguresAreTheNumbersByName) {
  Outer x;
  NamedFigures figures;
  describe(figures, x);
  ASSERT_EQ(figures.figures().size(), 3u);
  EXPECT_EQ(figures.figures()[0].first, "best_ratio");
  EXPECT_EQ(figures.figures()[2].first, "p");
  EXPECT_TRUE(std::isnan(figures.figures()[2].second));
  x.p = 0.25;
  NamedFigures now;
  describe(now, x);
  EXPECT_EQ(now.figures()[2].second, 0.25);
}

TEST(Verdict, NoneIsNeitherYesNorNo) {
  EXPECT_TRUE(Verdict::yes("consistent").isYes());
  EXPECT_FALSE(Verdict::none("no verdict: not tested").isYes());
  EXPECT_FALSE(Verdict::none("no verdict: not tested").isNo());
  EXPECT_EQ(Verdict().decided(), std::nullopt);
  EXPECT_EQ(Verdict::no("OVERCONFIDENT", {"joint"}).decided(), std::optional(false));
  EXPECT_EQ(pathsOf(fieldsOf<Verdict>()), (std::vector<std::string>{"verdict", "consistent", "causes"}));
}

TEST(Words, NumbersHaveTheDigitsAsked) {
  EXPECT_EQ(significant(1234.5678, 3), "1.23e+03");
  EXPECT_EQ(significant(0.5), "0.5");
  EXPECT_EQ(significant(std::nan("")), "n/a");
  EXPECT_EQ(significant(1. / 3, 40).size(), significant(1. / 3, 17).size());
}

TEST(Linear, PublicNamesAreThoseOfTheMathematics) {
  Eigen::Matrix3d A;
  A << 4, 1, 0, 1, 3, 0.5, 0, 0.5, 2;
  EXPECT_LT((A * Cholesky<double, 3>(A).inverse() - Eigen::Matrix3d::Identity()).norm(), 1e-15);
  const Eigen::Vector3d a(1, -2, 3), b(0.5, 4, -1);
  EXPECT_EQ(skew(a) * b, a.cross(b));
}

}  // namespace
}  // namespace liestat
