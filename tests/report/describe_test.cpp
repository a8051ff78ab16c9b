#include <report/describe.hpp>
#include <stats/shown.hpp>
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
  if (shown(v, x.p.has_value())) v("square", x.p.value_or(0) * x.p.value_or(0));
}

/// A view of values.
struct Names {
  std::vector<std::string> names;
  template <class T>
  Names& operator()(const char* name, const T&, const char* = "", const char* = "") {
    names.push_back(name);
    return *this;
  }
};

/// Names, those of inner results after their own.
std::vector<std::string> namesOf(const auto& fields) {
  std::vector<std::string> names;
  for (const FieldDescription& f : fields) {
    names.push_back(f.name);
    for (const std::string& inner : namesOf(f.fields)) names.push_back(f.name + "." + inner);
  }
  return names;
}

TEST(Describe, FieldsAreListedWhetherTheyHaveValuesOrNot) {
  static_assert(Described<Outer> && Described<Verdict> && !Described<double>);
  const std::vector<FieldDescription> fields = fieldsOf<Outer>();
  const std::vector<std::string> expected{"parts",   "parts.ratio", "parts.ok", "best", "best.ratio",
                                          "best.ok", "p",           "axis",     "word", "square"};
  EXPECT_EQ(namesOf(fields), expected);
  using Kind = FieldDescription::Kind;
  EXPECT_EQ(fields[0].meaning, "of the whole");
  EXPECT_EQ(fields[0].result, "Inner");
  EXPECT_TRUE(fields[0].list && !fields[0].optional);
  EXPECT_TRUE(fields[1].optional && fields[1].kind == Kind::result && fields[1].fields[1].kind == Kind::boolean);
  EXPECT_TRUE(fields[2].optional && fields[2].kind == Kind::number);
  EXPECT_TRUE(fields[3].kind == Kind::array && fields[3].rows == 3 && fields[3].columns == 1 && fields[3].unit == "m");
  EXPECT_EQ(fields[4].kind, Kind::text);
}

TEST(Describe, ViewsOfValuesPassOverWhatAResultLacks) {
  Names view;
  describe(view, Outer{});
  EXPECT_EQ(view.names.back(), "word");
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
  EXPECT_EQ(namesOf(fieldsOf<Verdict>()), (std::vector<std::string>{"verdict", "consistent", "causes"}));
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
