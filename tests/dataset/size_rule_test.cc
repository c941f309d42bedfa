#include "dataset/masks/size_rule.h"

#include "tests/dataset/dataset_test_util.h"

namespace mvstudio::dataset {
namespace {

geometry::RigCamera TallCamera() {
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole("cam", 1088, 1920, 1680);
  camera.cam_from_world.translation << 0, 0, 4;
  return camera;
}

TEST(SizeRule, EqualSizesNeedNone) {
  const auto rules = SizeRules(640, 480, 640, 480);
  ASSERT_EQ(rules.size(), 1u);
  EXPECT_EQ(rules[0].name, "same");
  const auto camera = TallCamera();
  EXPECT_EQ(ApplySizeRule(camera, rules[0], 1088, 1920).camera.params, camera.camera.params);
}

TEST(SizeRule, MoreThanTwoPercentIsRefused) {
  EXPECT_TRUE(SizeRules(1088, 1920, 1060, 1920).empty());
  EXPECT_TRUE(SizeRules(1920, 1080, 1080, 1920).empty());
  EXPECT_TRUE(SizeRules(1920, 1080, 960, 540).empty());
}

/// Each rule as what it does to an image: where a calibrated pixel edge lands in the footage.
TEST(SizeRule, RulesSayWhereTheEdgesLand) {
  for (const SizeRule& rule : SizeRules(1088, 1920, 1080, 1920)) {
    const auto edge = [&](double u) { return rule.scale_x * u + rule.offset_x_px; };
    if (rule.name == "crop-right") {
      EXPECT_DOUBLE_EQ(edge(0), 0);
    }
    if (rule.name == "crop-centre") {
      EXPECT_DOUBLE_EQ(edge(544), 540);
    }
    if (rule.name == "crop-left") {
      EXPECT_DOUBLE_EQ(edge(1088), 1080);
    }
    if (rule.name == "stretch" || rule.name == "fill") {
      EXPECT_DOUBLE_EQ(edge(0), 0);
      EXPECT_DOUBLE_EQ(edge(1088), 1080);
    }
    if (rule.name == "fill") {
      EXPECT_DOUBLE_EQ(rule.scale_x, rule.scale_y);
      EXPECT_DOUBLE_EQ(rule.scale_y * 960 + rule.offset_y_px, 960);
    }
  }
}

/// Projecting through the changed camera is projecting through the old one and moving the pixel.
TEST(SizeRule, CameraFollowsTheRule) {
  geometry::RigCamera camera = TallCamera();
  camera.camera.model = geometry::LensModel::kBrown5;
  camera.camera.params.conservativeResize(9);
  camera.camera.params.tail<5>() << -0.1, 0.05, 1e-3, -2e-3, 0.01;
  camera.params_covariance = Eigen::MatrixXd::Identity(9, 9);
  const Eigen::Vector3d x_in_cam(0.4, -0.7, 3.0);
  const Eigen::Vector2d old = geometry::Project(camera.camera, x_in_cam).px;
  for (const SizeRule& rule : SizeRules(1088, 1920, 1080, 1912)) {
    const geometry::RigCamera changed = ApplySizeRule(camera, rule, 1080, 1912);
    EXPECT_EQ(changed.camera.width_px, 1080);
    const Eigen::Vector2d px = geometry::Project(changed.camera, x_in_cam).px;
    EXPECT_NEAR(px.x() + 0.5, rule.scale_x * (old.x() + 0.5) + rule.offset_x_px, 1e-9) << rule.name;
    EXPECT_NEAR(px.y() + 0.5, rule.scale_y * (old.y() + 0.5) + rule.offset_y_px, 1e-9) << rule.name;
    EXPECT_NEAR((*changed.params_covariance)(0, 0), rule.scale_x * rule.scale_x, 1e-15);
    EXPECT_NEAR((*changed.params_covariance)(8, 8), 1, 1e-15);
  }
}

/// A drawn person seen through a known rule: the evidence must find it.
TEST(SizeRule, EvidenceFindsTheRuleWhenJointsAreExact) {
  const geometry::RigCamera calibrated = [] {
    geometry::RigCamera c;
    c.camera = geometry::MakePinhole("cam", 306, 400, 400);
    Eigen::Matrix3d axes;
    axes << 1, 0, 0, 0, 0, -1, 0, 1, 0;
    c.cam_from_world.rotation = Eigen::Quaterniond(axes);
    c.cam_from_world.translation << 0, 1.0, 2.6;
    return c;
  }();
  const auto rules = SizeRules(306, 400, 300, 400);
  for (const std::string truth : {"crop-left", "crop-right"}) {
    const SizeRule& rule = *std::find_if(rules.begin(), rules.end(), [&](const SizeRule& r) { return r.name == truth; });
    const geometry::RigCamera seen = ApplySizeRule(calibrated, rule, 300, 400);
    std::vector<Image> frames;
    std::vector<std::map<int, Coco19Pose>> people;
    for (int f = 0; f < 8; ++f) {
      people.push_back({{0, StandingPerson(0.1 * (f - 4))}});
      Image frame = RandomImage(300, 400, 3, 100 + f);
      for (uint8_t& p : frame.pixels) p = static_cast<uint8_t>(150 + p / 32);
      const Image body = BodyRegion(ProjectBody(people.back(), seen), 300, 400, 0.0);
      for (size_t i = 0; i < body.pixels.size(); ++i) {
        if (body.pixels[i]) frame.pixels[3 * i] = static_cast<uint8_t>(40 + frame.pixels[3 * i] % 8);
      }
      frames.push_back(frame);
    }
    const SizeDecision decision = DecideSizeRule(rules, calibrated, frames, people, 0.5, {});
    EXPECT_EQ(decision.rule.name, truth);
    EXPECT_TRUE(decision.decisive);
    const SizeDecision unsure =
        DecideSizeRule(rules, calibrated, frames, people, 10, {});  // joints as far off as the rules differ
    EXPECT_EQ(unsure.rule.name, "fill");
    EXPECT_FALSE(unsure.decisive);
  }
}

}  // namespace
}  // namespace mvstudio::dataset
