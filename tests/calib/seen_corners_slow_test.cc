#include <algorithm>
#include <functional>
#include <string>

#include "calib/calibrate.h"
#include "calib/check/rig_check.h"
#include "calib/corners/corner_files.h"
#include "tests/calib/filmed.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

/// Many calibrations against the corners that they were made from: whatever is put right in the input, nothing has moved.
namespace mvstudio::calib {
namespace {

using Change = std::function<void(Detection*)>;

void Turn(Detection* d) {
  for (int& id : d->corner_ids) id = 53 - id;
}

void ExpectAgreement(const CalibrateInput& input, const CalibrateOptions& options, const std::string& what) {
  const CalibrateReport report = Calibrate(input, options, {});
  ASSERT_EQ(report.status, Status::kOk) << what << ": " << report.message;
  EXPECT_TRUE(report.motions.empty()) << what << ": " << report.motions[0].cameras[0];
  const RigCheck check = CheckRig(report.rig, input, {}, {});
  EXPECT_EQ(check.status, Status::kOk) << what << ": " << check.message;
  EXPECT_TRUE(check.moved.empty() && check.undecided.empty()) << what;
  EXPECT_NE(check.verdict.outcome(), Outcome::kFail) << what << ": " << check.verdict.reasons[0].text;
}

TEST(SeenCornersSlow, TwoCamerasOneUpsideDown) {
  for (uint64_t seed = 1; seed <= 8; ++seed) {
    testing::SceneOptions scene;
    scene.num_frames = 25, scene.noise_px = 0.1, scene.seed = seed;
    CalibrateInput input = testing::ToInput(testing::MakeScene(scene));
    for (Detection& d : input.detections) d.camera_idx == 1 ? Turn(&d) : void();
    ExpectAgreement(input, WithClocks(), "seed " + std::to_string(seed));
  }
}

TEST(SeenCornersSlow, ALateCamera) {
  for (const double late : {0.18, 0.27, 0.36, 0.45, -0.3})
    ExpectAgreement(testing::ToInput(testing::Film({0, late, 0}, 60, 0.2)), WithClocks(), std::to_string(late));
}

TEST(SeenCornersSlow, FramesThatAreNumberedOtherwise) {
  for (const int64_t shift : {-41, -7, 1, 12, 41}) {
    CalibrateInput input = testing::ToInput(testing::Film({0, 0, 0}, 100, 0.2));
    for (Detection& d : input.detections) d.frame_idx += d.camera_idx == 2 ? shift : 0;
    ExpectAgreement(input, WithClocks(), std::to_string(shift) + " frames");
  }
}

TEST(SeenCornersSlow, ACameraThatMissesFrames) {
  CalibrateInput input = testing::ToInput(testing::Film({0, 0.3, 0}, 60, 0.2));
  const auto lost = [](const Detection& d) { return d.camera_idx == 1 && d.frame_idx % 5 == 0; };
  input.detections.erase(std::remove_if(input.detections.begin(), input.detections.end(), lost), input.detections.end());
  ExpectAgreement(input, WithClocks(), "every fifth image lost");
}

/// Corner files as users gave them.
TEST(SeenCornersSlow, Recordings) {
  MVS_NEEDS_DATA("reports/calib/22_two.csv");
  const CornerFile file = ReadCornerFile(mvstudio::testing::DataRoot() + "/reports/calib/22_two.csv");
  CalibrateInput input;
  input.boards = file.boards, input.cameras = file.cameras, input.detections = file.detections;
  ExpectAgreement(input, {}, "22_two");
}

}  // namespace
}  // namespace mvstudio::calib
