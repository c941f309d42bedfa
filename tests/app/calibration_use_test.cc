#include "app/calib/calibration_use.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <tuple>

#include "tests/triangulate/support.h"

namespace mvstudio::app {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

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
  ReportCovarianceUse(Partly(), {}, "", &result);
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
    ReportCovarianceUse(rig, {}, unused, &result);
    EXPECT_EQ(result.metrics["calibration_covariance"]["used"], used);
    EXPECT_THAT(result.warnings, IsEmpty());
    EXPECT_EQ(result.metrics["calibration_covariance"]["assumed"].is_null(), !used);
  }
  geometry::Rig joint = Known();
  joint.joint_covariance = Eigen::MatrixXd::Identity(30, 30);
  CommandResult result;
  ReportCovarianceUse(joint, {}, "", &result);
  EXPECT_EQ(result.metrics["calibration_covariance"]["correlated"], true);
  EXPECT_TRUE(result.metrics["calibration_covariance"]["assumed"].is_null());
}

/// What is known of a camera that takes no part is in nobody's sigma.
TEST(CalibrationUse, KnowledgeOfOtherCamerasIsNotUsed) {
  CommandResult result;
  ReportCovarianceUse(Partly(), {"c"}, "", &result);
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
  CommandResult none, some;
  ReportOffsetsUnused(WithOffset(0.004), "why", &none);
  EXPECT_TRUE(none.metrics.empty());
  ReportOffsetsUnused(WithOffset(1), "why", &some);
  EXPECT_EQ(some.metrics["calibration_offsets"]["applied"], false);
  EXPECT_EQ(some.metrics["calibration_offsets"]["reason"], "why");
}

}  // namespace
}  // namespace mvstudio::app
