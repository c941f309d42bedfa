#include "calib/points/stated_length.h"

#include "core/error.h"
#include "core/random.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

std::string Refusal(const std::string& text) {
  try {
    ParseStatedLength(text);
  } catch (const UsageError& error) {
    return error.what();
  }
  return "";
}

TEST(StatedLength, IsRead) {
  const StatedLength plain = ParseStatedLength("LShoulder:RShoulder:380mm");
  EXPECT_EQ(plain.Name(), "LShoulder:RShoulder");
  EXPECT_DOUBLE_EQ(plain.length_m, 0.38);
  EXPECT_EQ(plain.sigma_m, 0);
  const StatedLength sigma = ParseStatedLength("A:B:1.75m:2mm");
  EXPECT_DOUBLE_EQ(sigma.length_m, 1.75);
  EXPECT_DOUBLE_EQ(sigma.sigma_m, 0.002);
  EXPECT_TRUE(ParseStatedLength("Height:175cm").IsHeight());
  EXPECT_DOUBLE_EQ(ParseStatedLength("A:B:10in").length_m, 0.254);
}

TEST(StatedLength, NonsenseIsOneClearLine) {
  for (const char* text : {"", "A", "A:B", "A:B:", "A:B:1.75", "A:B:m", "A:B:1.75km", "A:B:nanm", "A:B:infm"})
    EXPECT_THAT(Refusal(text), HasSubstr("no length with a unit")) << text;
  for (const char* text : {"A:B:0m", "A:B:-3mm", "Height:0m"}) EXPECT_THAT(Refusal(text), HasSubstr("above 0")) << text;
  EXPECT_THAT(Refusal("A:B:1m:0mm"), HasSubstr("a standard deviation must be above 0"));
  EXPECT_THAT(Refusal("A:B:1mm:2m"), HasSubstr("as large as the length"));
  EXPECT_THAT(Refusal("A:A:1m"), HasSubstr("the two points are one"));
  EXPECT_THAT(Refusal("A:B:C:1m"), HasSubstr("more than two points"));
  EXPECT_THAT(Refusal("A:1m"), HasSubstr("two points are needed"));
  EXPECT_THAT(Refusal(":B:1m"), HasSubstr("two points are needed"));
}

TEST(StatedLength, PointsThatDoNotExistAreNamed) {
  const auto refusal = [](const std::string& text, const std::vector<std::string>& names) -> std::string {
    try {
      LengthsOf({ParseStatedLength(text)}, names);
    } catch (const UsageError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal("A:C:1m", {"A", "B"}), HasSubstr("there is no point 'C'; the points are A, B"));
  EXPECT_THAT(refusal("Height:1.8m", {"A", "B"}), HasSubstr("a height needs a person's joints"));
  EXPECT_EQ(LengthsOf({ParseStatedLength("Height:1.8m")}, {"LHip", "LKnee", "LAnkle"}).size(), 2u);
}

/// Two sticks of a rig that is 4 % too small, measured with noise.
std::vector<NamedPoints> Moments(int count, double noise_m) {
  Rng rng(3);
  std::vector<NamedPoints> moments;
  for (int i = 0; i < count; ++i) {
    const auto noise = [&] { return Eigen::Vector3d(noise_m * rng.Normal(), noise_m * rng.Normal(), noise_m * rng.Normal()); };
    const Eigen::Vector3d at(rng.Uniform(-1, 1), rng.Uniform(-1, 1), rng.Uniform(0, 2));
    moments.push_back({{"A", at + noise()},
                       {"B", at + Eigen::Vector3d(0.5 / 1.04, 0, 0) + noise()},
                       {"C", at + Eigen::Vector3d(0, 0.3 / 1.04, 0) + noise()}});
  }
  return moments;
}

TEST(StatedLength, ScaleWithItsUncertainty) {
  const auto moments = Moments(400, 0.004);
  const LengthScale one = ScaleFromLengths({ParseStatedLength("A:B:500mm")}, moments);
  ASSERT_EQ(one.status, Status::kOk) << one.message;
  EXPECT_GT(one.sigma, 2e-4);  // 4 mm * sqrt(2) of 480 mm, over the root of 400, by medians
  EXPECT_LT(one.sigma, 2e-3);
  EXPECT_NEAR(one.scale / 1.04, 1, 4 * one.sigma);
  EXPECT_NEAR(one.rows[0].spread, 0.0118, 0.002);
  EXPECT_EQ(one.rows[0].num_moments, 400);
  const LengthScale both = ScaleFromLengths({ParseStatedLength("A:B:500mm:1mm"), ParseStatedLength("A:C:300mm:1mm")}, moments);
  EXPECT_NEAR(both.scale / 1.04, 1, 4 * both.sigma);
  EXPECT_LT(both.disagreement, 3);
  EXPECT_GT(ScaleFromLengths({ParseStatedLength("A:B:500mm:1mm"), ParseStatedLength("A:C:350mm:1mm")}, moments).disagreement,
            3);
}

TEST(StatedLength, PointsThatAreNeverTogetherGiveNoScale) {
  auto moments = Moments(4, 0);
  for (size_t i = 0; i < moments.size(); ++i) moments[i].erase(i % 2 ? "A" : "B");
  const LengthScale scale = ScaleFromLengths({ParseStatedLength("A:B:500mm")}, moments);
  EXPECT_EQ(scale.status, Status::kTooFewViews);
  EXPECT_THAT(scale.message, HasSubstr("A and B have no points at the same time"));
}

}  // namespace
}  // namespace mvstudio::calib
