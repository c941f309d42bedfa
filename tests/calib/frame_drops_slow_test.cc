#include <algorithm>
#include <cmath>
#include <map>

#include "calib/calibrate.h"
#include "calib/check/rig_check.h"
#include "calib/rig/frame_drops.h"
#include "tests/calib/filmed.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

/// Cameras that lost frames, beside cameras that moved, were late or whose clock drifts.
namespace mvstudio::calib {
namespace {

CalibrateOptions WithMotions() {
  CalibrateOptions options = testing::PlainOptions();
  options.model = geometry::LensModel::kBrown4;
  options.time_offset = TimeOffsetChoice::kAuto;
  return options;
}

/// The camera lost `count` frames after frame `after`; the rest is numbered on.
void Lose(Scene* scene, int camera, int64_t after, int64_t count) {
  std::vector<Detection> kept;
  for (Detection d : scene->detections) {
    const bool later = d.camera_idx == camera && d.frame_idx > after;
    if (later && d.frame_idx <= after + count) continue;
    d.frame_idx -= later ? count : 0;
    kept.push_back(d);
  }
  scene->detections = kept;
}

/// From this frame on the camera is turned about its centre by 1.2 degrees.
void Turn(Scene* scene, int camera, int64_t from) {
  const geometry::Projector lens(scene->truth.cameras[static_cast<size_t>(camera)]);
  const Eigen::Quaterniond turn = geometry::RotationExp({0.008, 0.018, 0.006});
  for (Detection& d : scene->detections) {
    if (d.camera_idx != camera || d.frame_idx < from) continue;
    for (int i = 0; i < d.num_corners(); ++i) {
      const Eigen::Vector2d px = d.points_px.col(i);
      d.points_px.col(i) = lens.Project(turn * lens.Unproject(px).ray_in_cam).px;
    }
  }
}

std::string Reasons(const CalibrateReport& report) {
  std::string text = report.message;
  for (const auto& reason : report.verdict.reasons) text += "\n" + reason.code + ": " + reason.text;
  return text;
}

void ExpectTruth(const CalibrateReport& report, const Scene& scene) {
  ASSERT_EQ(report.status, Status::kOk) << Reasons(report);
  EXPECT_LT(report.rms_px, 0.4) << Reasons(report);
  for (size_t c = 0; c < report.cameras.size(); ++c)
    EXPECT_NEAR(report.cameras[c].focal_px, scene.truth.cameras[c].fx() * 1.001, 3) << c;
}

TEST(FrameDrops, OfTheMiddleAreNamedAndMended) {
  for (const int count : {1, 5, 20}) {
    Scene scene = Film({0, 0, 0}, 120, 0.2);
    Lose(&scene, 1, 70, count);
    const CalibrateReport report = Calibrate(testing::ToInput(scene), WithMotions(), RunContext());
    ExpectTruth(report, scene);
    ASSERT_EQ(report.frame_drops.size(), 1u) << count << Reasons(report);
    const FrameDrop& drop = report.frame_drops[0];
    EXPECT_EQ(drop.camera_idx, 1);
    EXPECT_EQ(drop.count, count);
    EXPECT_LE(drop.last_before, 70);
    EXPECT_GT(drop.frame, 70);
    EXPECT_LE(drop.frame - drop.last_before, 6) << count;
    EXPECT_NE(Reasons(report).find("cam1 lost"), std::string::npos) << Reasons(report);
    for (const char* code : {"CAL-MOVED", "CAL-LENSCHANGED", "CAL-UNEXPLAINED", "CAL-LATE", "CAL-CONTRADICTS"})
      EXPECT_FALSE(HasReason(report, code)) << code;
    const RigCheck check = CheckRig(report.rig, testing::ToInput(scene), {}, RunContext());
    EXPECT_TRUE(check.moved.empty()) << "calib eval of its own corners";
    EXPECT_EQ(check.found.frame_drops.size(), 1u);
  }
}

TEST(FrameDrops, SeveralInTwoCameras) {
  Scene scene = Film({0, 0, 0, 0}, 120, 0.2);
  Lose(&scene, 1, 90, 3);
  Lose(&scene, 1, 50, 2);
  Lose(&scene, 3, 70, 8);
  const CalibrateReport report = Calibrate(testing::ToInput(scene), WithMotions(), RunContext());
  ExpectTruth(report, scene);
  std::vector<std::pair<int, int64_t>> found;
  for (const FrameDrop& drop : report.frame_drops) found.emplace_back(drop.camera_idx, drop.count);
  EXPECT_EQ(found, (std::vector<std::pair<int, int64_t>>{{1, 2}, {1, 3}, {3, 8}})) << Reasons(report);
}

TEST(FrameDrops, FramesWrittenTwiceAreTooMany) {
  Scene scene = Film({0, 0, 0, 0}, 100, 0.2);
  std::vector<Detection> with_repeats;
  for (Detection d : scene.detections) {
    if (d.camera_idx == 2 && d.frame_idx == 60) {
      for (int k = 0; k < 4; ++k, ++d.frame_idx) with_repeats.push_back(d);
      continue;
    }
    if (d.camera_idx == 2 && d.frame_idx > 60) d.frame_idx += 4;
    with_repeats.push_back(d);
  }
  scene.detections = with_repeats;
  const CalibrateReport report = Calibrate(testing::ToInput(scene), WithMotions(), RunContext());
  ExpectTruth(report, scene);
  EXPECT_NE(Reasons(report).find("cam2 has "), std::string::npos) << Reasons(report);
  for (const FrameDrop& drop : report.frame_drops) EXPECT_EQ(drop.camera_idx, 2);
}

TEST(FrameDrops, OtherFaultsAreNone) {
  const Scene clean = Film({0, 0, 0}, 100, 0.2);
  Scene moved = clean, both = Film({0, 0, 0}, 100, 0.2, 2), late = Film({0, 0.4, 0}, 100, 0.2);
  Turn(&moved, 1, 60);
  Turn(&both, 1, 50);
  Turn(&both, 2, 80);
  const std::map<std::string, Scene> scenes = {{"clean", clean},
                                               {"moved", moved},
                                               {"both moved", both},
                                               {"late", late},
                                               {"clock", Film({0, 0, 0}, 100, 0.2, 1, {0, 0.008, 0})},
                                               {"fast clock", Film({0, 0, 0}, 100, 0.2, 1, {0, 0.03, 0})}};
  for (const auto& [name, scene] : scenes) {
    const CalibrateReport report = Calibrate(testing::ToInput(scene), WithMotions(), RunContext());
    EXPECT_TRUE(report.frame_drops.empty()) << name << Reasons(report);
  }
}

TEST(FrameDrops, LateAndMovedAreBothSaid) {
  for (const int moved : {1, 2}) {  // the late camera itself, or another
    Scene scene = Film({0, 0, 0, 0}, 100, 0.2);
    Turn(&scene, moved, 60);
    for (Detection& d : scene.detections) d.frame_idx += d.camera_idx == 1 ? 7 : 0;
    const CalibrateReport report = Calibrate(testing::ToInput(scene), WithMotions(), RunContext());
    ASSERT_EQ(report.status, Status::kOk) << Reasons(report);
    EXPECT_EQ(report.frame_shift, (std::vector<int64_t>{0, -7, 0, 0})) << moved << Reasons(report);
    ASSERT_EQ(report.motions.size(), 1u) << moved << Reasons(report);
    EXPECT_EQ(report.motions[0].cameras, (std::vector<std::string>{"cam" + std::to_string(moved)}));
    EXPECT_NEAR(static_cast<double>(report.motions[0].frame_idx), moved == 1 ? 67 : 60, 1)
        << "as the camera numbers its frames";
    EXPECT_TRUE(HasReason(report, "CAL-FRAMES") && HasReason(report, "CAL-MOVED")) << Reasons(report);
    EXPECT_FALSE(HasReason(report, "CAL-LENSCHANGED")) << Reasons(report);
  }
}

TEST(FrameDrops, DroppedAndMovedAreBothSaid) {
  Scene scene = Film({0, 0, 0, 0}, 110, 0.2);
  Turn(&scene, 2, 60);
  Lose(&scene, 1, 80, 6);
  const CalibrateReport report = Calibrate(testing::ToInput(scene), WithMotions(), RunContext());
  ASSERT_EQ(report.status, Status::kOk) << Reasons(report);
  ASSERT_EQ(report.frame_drops.size(), 1u) << Reasons(report);
  EXPECT_EQ(report.frame_drops[0].camera_idx, 1);
  EXPECT_EQ(report.frame_drops[0].count, 6);
  ASSERT_EQ(report.motions.size(), 1u) << Reasons(report);
  EXPECT_EQ(report.motions[0].cameras, (std::vector<std::string>{"cam2"}));
}

TEST(FrameDrops, PartOfAFrameLateAndMovedAreBothSaidOrNone) {
  Scene scene = Film({0, 0.4, 0, 0}, 100, 0.2);
  Turn(&scene, 1, 60);
  const CalibrateReport report = Calibrate(testing::ToInput(scene), WithMotions(), RunContext());
  ASSERT_EQ(report.status, Status::kOk) << Reasons(report);
  const bool late = std::abs(report.cameras[1].time_offset_frames - 0.4) < 0.1;
  const bool moved = report.motions.size() == 1 && report.motions[0].cameras == std::vector<std::string>{"cam1"};
  EXPECT_TRUE((late && moved) || HasReason(report, "CAL-UNEXPLAINED")) << Reasons(report);
}

TEST(FrameDrops, TextAndNumbersThereAndBack) {
  const std::vector<FrameDrop> drops = {{1, 40, 41, 5}, {1, 60, 64, -2}};
  EXPECT_EQ(
      ToString(drops, {"a", "b"}),
      "frames with the same number were not taken at the same time: b lost 5 frames after frame 40, b has 2 frames too many "
      "between frames 60 and 64");
  std::vector<Detection> detections;
  for (int f = 38; f < 70; ++f) {
    detections.emplace_back();
    detections.back().camera_idx = 1, detections.back().frame_idx = f;
  }
  ApplyFrameDrops(drops, &detections);
  EXPECT_EQ(detections.size(), 29u) << "frames 61 to 63 may be on either side";
  std::vector<int64_t> own;
  for (const Detection& d : detections) own.push_back(FrameBeforeDrops(drops, 1, d.frame_idx));
  for (const int64_t f : {38, 40, 41, 60, 64, 69}) EXPECT_EQ(std::count(own.begin(), own.end(), f), 1) << f;
  EXPECT_EQ(FrameBeforeDrops(drops, 0, 50), 50);
}

}  // namespace
}  // namespace mvstudio::calib
