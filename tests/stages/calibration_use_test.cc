#include "stages/calib/calibration_use.h"

#include <cmath>
#include <tuple>

#include "tests/support/test.h"
#include "tests/triangulate/support.h"

namespace mvstudio::stages {
namespace {

/// Cameras a, b and c, of which nothing is known.
geometry::Rig Unknown() {
  geometry::Rig rig;
  for (const char* name : {"a", "b", "c"}) {
    rig.cameras.push_back(triangulate::LookAt(name, {static_cast<double>(rig.cameras.size()), 3, 0.5}, {0, 0, 0}));
  }
  return rig;
}

void KnowLens(geometry::RigCamera* camera) { camera->params_covariance = Eigen::MatrixXd::Identity(4, 4); }
void KnowPose(geometry::RigCamera* camera) { camera->cam_from_world_covariance = Eigen::Matrix<double, 6, 6>::Identity(); }

geometry::Rig Known() {
  geometry::Rig rig = Unknown();
  for (geometry::RigCamera& camera : rig.cameras) KnowLens(&camera), KnowPose(&camera);
  return rig;
}

/// All of a, the lens of b, nothing of c.
geometry::Rig Partly() {
  geometry::Rig rig = Unknown();
  KnowLens(&rig.cameras[0]), KnowPose(&rig.cameras[0]), KnowLens(&rig.cameras[1]);
  return rig;
}

TEST(CalibrationUse, OneLineSaysWhatIsInTheSigmas) {
  EXPECT_THAT(CovarianceUse(Unknown(), {}, ""), HasSubstr("unknown, it carries no covariance"));
  EXPECT_THAT(CovarianceUse(Unknown(), {}, "it is off"), HasSubstr("unknown, it carries no covariance"));
  EXPECT_THAT(CovarianceUse(Known(), {}, ""), HasSubstr("in the sigmas, of all cameras"));
  EXPECT_THAT(CovarianceUse(Known(), {}, "it is off"), HasSubstr("not used, it is off"));
  EXPECT_THAT(CovarianceUse(Partly(), {}, ""), HasSubstr("unknown for b, c,"));
  EXPECT_THAT(CovarianceUse(Partly(), {"a", "c"}, ""), HasSubstr("unknown for c,"));
  EXPECT_THAT(CovarianceUse(Partly(), {"a"}, ""), HasSubstr("in the sigmas, of all cameras")) << "b and c take no part";
}

TEST(CalibrationUse, TheSameAsMetricsWithWhatEachCameraLacks) {
  CommandResult result;
  result.text = "before\n";
  result.Add(DescribeCovarianceUse(Partly(), {}, ""));
  const nlohmann::ordered_json use = result.metrics["calibration_covariance"];
  EXPECT_EQ(use["used"], true);
  EXPECT_EQ(use["known"], nlohmann::ordered_json::array({"a"}));
  EXPECT_EQ(use["missing"],
            nlohmann::ordered_json::parse(R"([{"camera": "b", "lacks": "pose"}, {"camera": "c", "lacks": "lens and pose"}])"));
  EXPECT_EQ(use["correlated"], false);
  EXPECT_EQ(use["assumed"], "blocks independent of each other");
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_EQ(result.warnings[0].code, "CAL-COVARIANCE-MISSING");
  EXPECT_EQ(result.text, "before\n" + CovarianceUse(Partly(), {}, "") + "\n");
}

TEST(CalibrationUse, NothingIsWarnedOfWhereAllOrNothingIsKnownOrUsed) {
  for (const auto& [rig, unused, used] :
       {std::tuple(Known(), "", true), {Unknown(), "", false}, {Partly(), "it is off", false}}) {
    CommandResult result;
    result.Add(DescribeCovarianceUse(rig, {}, unused));
    EXPECT_EQ(result.metrics["calibration_covariance"]["used"], used);
    EXPECT_THAT(result.warnings, IsEmpty());
    EXPECT_EQ(result.metrics["calibration_covariance"]["assumed"].is_null(), !used);
  }
  geometry::Rig joint = Known();
  joint.joint_covariance = Eigen::MatrixXd::Identity(30, 30);
  CommandResult result;
  result.Add(DescribeCovarianceUse(joint, {}, ""));
  EXPECT_EQ(result.metrics["calibration_covariance"]["correlated"], true);
  EXPECT_TRUE(result.metrics["calibration_covariance"]["assumed"].is_null());
}

/// What is known of a camera that takes no part is in nobody's sigma.
TEST(CalibrationUse, KnowledgeOfOtherCamerasIsNotUsed) {
  CommandResult result;
  result.Add(DescribeCovarianceUse(Partly(), {"c"}, ""));
  EXPECT_EQ(result.metrics["calibration_covariance"]["used"], false);
  EXPECT_THAT(result.warnings, IsEmpty()) << "no camera that takes part has a covariance";
  EXPECT_THAT(result.text, HasSubstr("unknown"));
  EXPECT_THAT(result.text, Not(HasSubstr("in the sigmas where it is known")));
}

geometry::Rig WithOffset(double frames) {
  geometry::Rig rig = Unknown();
  rig.cameras[1].time_offset = geometry::TimeOffset{frames, 0.01};
  return rig;
}

TEST(CalibrationUse, OffsetsThatMoveNothingAreNone) {
  EXPECT_THAT(OffsetsOfCalibration(Unknown()), IsEmpty());
  EXPECT_THAT(OffsetsOfCalibration(WithOffset(0.004)), IsEmpty());
  EXPECT_THAT(OffsetsOfCalibration(WithOffset(0.006)), ElementsAre(0, 0.006, 0));
  EXPECT_THAT(OffsetsOfCalibration(WithOffset(-0.006)), ElementsAre(0, -0.006, 0));
  EXPECT_FALSE(OffsetsUnused(WithOffset(0.004), "why"));
  const std::optional<OffsetUse> some = OffsetsUnused(WithOffset(1), "why");
  ASSERT_TRUE(some);
  EXPECT_EQ(OffsetUseJson(*some).dump(), R"({"applied":false,"reason":"why"})");
}

/// Five joints on paths of their own, filmed by a ring whose camera 1 is late: its frame n shows the time n - late_frames.
PoseInput Filmed(double late_frames, double stated_frames) {
  PoseInput input;
  input.rig = triangulate::MakeRing(5);
  input.rig.cameras[1].time_offset = geometry::TimeOffset{stated_frames, 0.01};
  input.skeleton = geometry::PointsSkeleton({"a", "b", "c", "d", "e"});
  Rng rng(5);
  for (int f = 0; f < 60; ++f) {
    triangulate::DetectedFrame& frame = input.frames.emplace_back();
    frame.frame = f, frame.people.resize(input.rig.cameras.size());
    for (size_t c = 0; c < input.rig.cameras.size(); ++c) {
      const double t = f - (c == 1 ? late_frames : 0);
      triangulate::DetectedPerson& person = frame.people[c].emplace_back();
      for (int j = 0; j < 5; ++j) {
        const Eigen::Vector3d x(0.4 * std::sin(0.2 * t + j), 0.3 * std::cos(0.27 * t - j),
                                0.2 * j - 0.4 + 0.1 * std::sin(0.4 * t));
        const auto seen = geometry::Project(input.rig.cameras[c].camera, input.rig.cameras[c].cam_from_world * x);
        person.push_back({seen.px + Eigen::Vector2d(rng.Normal(), rng.Normal()), 0.9});
      }
    }
  }
  return input;
}

/// The first joint; frames have their numbers, offsets leave some out.
Eigen::Vector2d PixelAt(const PoseInput& input, int frame, size_t camera) {
  for (const triangulate::DetectedFrame& each : input.frames)
    if (each.frame == frame) return each.people[camera][0][0].px;
  return {NAN, NAN};
}

TEST(ApplyCalibrationOffsets, AreAppliedWhereTheTakeConfirmsThem) {
  PoseInput input = Filmed(1.5, 1.5);
  const PoseInput before = input;
  InputNotes result;
  const auto use = ApplyCalibrationOffsets(AutoOnOff::kAuto, {}, {}, &input, &result);
  ASSERT_TRUE(use);
  EXPECT_TRUE(use->applied) << use->reason;
  EXPECT_THAT(use->frames, ElementsAre(0, 1.5, 0, 0, 0));
  EXPECT_THAT(result.warnings, IsEmpty());
  // Frame 20 now holds what the late camera saw halfway between its frames 21 and 22.
  const Eigen::Vector2d between = 0.5 * (PixelAt(before, 21, 1) + PixelAt(before, 22, 1));
  EXPECT_LT((PixelAt(input, 20, 1) - between).norm(), 6) << "noise of 1 px and the curve of the path";
  EXPECT_GT((PixelAt(before, 20, 1) - between).norm(), 12);
  EXPECT_EQ(PixelAt(input, 20, 0), PixelAt(before, 20, 0));
}

TEST(ApplyCalibrationOffsets, AreLeftOutWithAWarningWhereTheTakeContradicts) {
  PoseInput input = Filmed(0, 1.5);
  const Eigen::Vector2d before = PixelAt(input, 20, 1);
  InputNotes result;
  EXPECT_FALSE(ApplyCalibrationOffsets(AutoOnOff::kAuto, {}, {}, &input, &result)->applied);
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_EQ(result.warnings[0].code, "TRI-OFFSETS-UNUSED");
  EXPECT_EQ(PixelAt(input, 20, 1), before);
}

TEST(ApplyCalibrationOffsets, OnAndOffAskNobody) {
  PoseInput on = Filmed(0, 1.5), off = Filmed(1.5, 1.5), none = Filmed(1.5, 0);
  const Eigen::Vector2d before = PixelAt(off, 20, 1);
  InputNotes notes;
  EXPECT_TRUE(ApplyCalibrationOffsets(AutoOnOff::kOn, {}, {}, &on, &notes)->applied);
  EXPECT_FALSE(ApplyCalibrationOffsets(AutoOnOff::kOff, {}, {}, &off, &notes)->applied);
  EXPECT_FALSE(ApplyCalibrationOffsets(AutoOnOff::kOn, {}, {}, &none, &notes)) << "the calibration states no offset";
  EXPECT_NE(PixelAt(on, 20, 1), PixelAt(Filmed(0, 1.5), 20, 1));
  EXPECT_EQ(PixelAt(off, 20, 1), before);
}

TEST(CalibrationUse, ARigThatIsWrittenNamesCamerasWithoutCovariance) {
  const CommandResult known = DescribeWrittenCovariance(Known());
  EXPECT_EQ(known.metrics["covariance_missing"], nlohmann::ordered_json::array());
  EXPECT_THAT(known.warnings, IsEmpty());
  const CommandResult partly = DescribeWrittenCovariance(Partly(), {"c", "d"});
  EXPECT_EQ(partly.metrics["covariance_missing"], nlohmann::ordered_json::array({"b", "c", "d"})) << "c once";
  EXPECT_EQ(partly.metrics["joint_covariance_written"], false);
  ASSERT_EQ(partly.warnings.size(), 1u);
  EXPECT_EQ(partly.warnings[0].code, "CAL-COVARIANCE-MISSING");
}

}  // namespace
}  // namespace mvstudio::stages
