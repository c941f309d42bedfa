#include "calib/pipeline/held_conflict.h"

#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

/// Three cameras with their true calibration to start from.
CalibrateInput Given() {
  testing::SceneOptions options;
  options.num_cameras = 3;
  options.noise_px = 0.2;
  const testing::Scene scene = testing::MakeScene(options);
  CalibrateInput input = testing::ToInput(scene);
  input.start = testing::TruthRig(scene);
  return input;
}

std::string ConflictOf(const CalibrateInput& input, const std::string& fix) {
  CalibrateOptions options = testing::PlainOptions();
  options.model = geometry::LensModel::kBrown4;
  FromString(fix, &options.fix.emplace_back());
  return Calibrate(input, options, RunContext()).held_conflict;
}

/// About its axis: a turn aside looks like another principal point.
TEST(HeldConflict, ACameraThatWasRolledIsNamed) {
  CalibrateInput input = Given();
  geometry::Rigid3& pose = input.start->cameras[1].cam_from_world;
  pose.rotation = geometry::RotationExp(Eigen::Vector3d(0, 0, 2 * M_PI / 180)) * pose.rotation;
  const std::string conflict = ConflictOf(input, "poses");
  EXPECT_NE(conflict.find("the given pose of camera cam1"), std::string::npos) << conflict;
}

TEST(HeldConflict, AWrongLensIsNamed) {
  CalibrateInput input = Given();
  input.start->cameras[2].camera.params[4] += 0.4;
  const std::string conflict = ConflictOf(input, "lenses:cam2");
  EXPECT_NE(conflict.find("the given lens of camera cam2"), std::string::npos) << conflict;
}

TEST(HeldConflict, ACameraIsNamedAfterFramesWereShiftedToo) {
  CalibrateInput input = Given();
  geometry::Rigid3& pose = input.start->cameras[1].cam_from_world;
  pose.rotation = geometry::RotationExp(Eigen::Vector3d(0, 0, 2 * M_PI / 180)) * pose.rotation;
  for (Detection& d : input.detections) d.frame_idx += d.camera_idx == 2 ? 3 : 0;
  CalibrateOptions options = testing::PlainOptions();
  options.model = geometry::LensModel::kBrown4;
  options.time_offset = TimeOffsetChoice::kAuto;
  options.fix = {{HeldPart::What::kPoses, {}}};
  const CalibrateReport report = Calibrate(input, options, RunContext());
  EXPECT_EQ(report.frame_shift, (std::vector<int64_t>{0, 0, -3})) << report.message;
  EXPECT_NE(report.held_conflict.find("the given pose of camera cam1"), std::string::npos) << report.held_conflict;
}

TEST(HeldConflict, TrueNumbersAreNotDoubted) {
  const CalibrateInput input = Given();
  for (const char* const fix : {"poses", "lenses", "lenses:cam1", "poses:cam0,cam2"})
    EXPECT_EQ(ConflictOf(input, fix), "") << fix;
}

}  // namespace
}  // namespace mvstudio::calib
