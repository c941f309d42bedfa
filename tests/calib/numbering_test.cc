#include "calib/rig/numbering.h"

#include <algorithm>
#include <functional>

#include "calib/lens/resection.h"
#include "geometry/rig/alignment.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

/// Faults of a scene whose boards `renumber` (camera, corner -> corner, or -1) calls otherwise.
template <class Renumber>
std::vector<NumberingFault> Faults(int cameras, double noise_px, const Renumber& renumber) {
  testing::SceneOptions options;
  options.num_cameras = cameras;
  options.noise_px = noise_px;
  testing::Scene scene = testing::MakeScene(options);
  std::vector<View> views;
  std::vector<geometry::Rigid3> poses;
  for (Detection detection : scene.detections) {
    Detection renumbered = detection;
    renumbered.corner_ids.clear();
    std::vector<int> kept;
    for (int i = 0; i < detection.num_corners(); ++i) {
      const int id = renumber(detection.camera_idx, detection.corner_ids[static_cast<size_t>(i)]);
      if (id >= 0) renumbered.corner_ids.push_back(id), kept.push_back(i);
    }
    renumbered.points_px = detection.points_px(Eigen::all, kept).eval();
    views.push_back(MakeView({scene.board}, renumbered, scene.truth.frames));
    const Resection pose = ResectPlane(scene.truth.cameras[static_cast<size_t>(detection.camera_idx)], views.back());
    poses.push_back(pose.cam_from_board);
  }
  return FindNumberingFaults(views, poses, geometry::CameraNames(scene.truth.cameras));
}

TEST(Numbering, ACameraThatCountsFromTheOtherEndIsNamed) {
  const auto faults = Faults(4, 0.3, [](int camera, int id) { return camera == 2 ? 53 - id : id; });
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_EQ(faults[0].cameras, std::vector<std::string>{"cam2"});
  EXPECT_EQ(faults[0].what, "turned by half a turn");
  EXPECT_LT(4 * faults[0].mended_spread, faults[0].spread);
}

TEST(Numbering, OfTwoCamerasBothAreNamed) {
  const auto faults = Faults(2, 0.3, [](int camera, int id) { return camera == 1 ? 53 - id : id; });
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_EQ(faults[0].cameras, (std::vector<std::string>{"cam0", "cam1"}));
}

TEST(Numbering, AColumnLessIsNamed) {
  const auto faults = Faults(4, 0.1, [](int camera, int id) { return camera != 1 ? id : id % 9 < 8 ? id + 1 : -1; });
  ASSERT_EQ(faults.size(), 1u);
  EXPECT_EQ(faults[0].cameras, std::vector<std::string>{"cam1"});
  EXPECT_EQ(faults[0].what, "shifted by a column");
}

TEST(Numbering, CamerasThatAgreeHaveNoFault) {
  for (const double noise : {0.0, 0.3, 2.0}) EXPECT_TRUE(Faults(3, noise, [](int, int id) { return id; }).empty()) << noise;
  EXPECT_TRUE(Faults(3, 0.1, [](int, int id) { return 53 - id; }).empty()) << "all alike is no fault";
  EXPECT_TRUE(FindNumberingFaults({}, {}, {"a"}).empty());
}

/// A recording whose views `turns` (camera, frame) number from the other end.
template <class Turns>
CalibrateInput Recording(const testing::SceneOptions& options, const Turns& turns) {
  CalibrateInput input = testing::ToInput(testing::MakeScene(options));
  for (Detection& d : input.detections) {
    if (!turns(d.camera_idx, d.frame_idx)) continue;
    for (int& id : d.corner_ids) id = 53 - id;
  }
  return input;
}

CalibrateReport Solved(const CalibrateInput& input) {
  CalibrateOptions options = testing::PlainOptions();
  options.model = geometry::LensModel::kBrown4;
  options.motions = false;
  return Calibrate(input, options, RunContext());
}

/// What a detector of chessboards does that numbers every image by itself: the same rig as from equal numbers.
TEST(Numbering, RotatedViewsAreRotatedBack) {
  testing::SceneOptions scene;
  scene.num_cameras = 3, scene.noise_px = 0.1;
  const CalibrateReport truth = Solved(Recording(scene, [](int, int64_t) { return false; }));
  ASSERT_EQ(truth.status, Status::kOk);
  EXPECT_TRUE(truth.rotated.empty());
  const std::vector<std::pair<const char*, std::function<bool(int, int64_t)>>> recordings = {
      {"one camera", [](int c, int64_t) { return c == 2; }},
      {"some views of a camera", [](int c, int64_t f) { return c == 1 && f % 9 == 1; }},
      {"half of the views", [](int c, int64_t f) { return c == 1 && f % 2 == 0; }},
      {"any view", [](int c, int64_t f) { return (c * 7 + f * 5) % 11 < 5; }}};
  for (const auto& [what, turns] : recordings) {
    const CalibrateReport report = Solved(Recording(scene, turns));
    ASSERT_EQ(report.status, Status::kOk) << what << ": " << report.message;
    EXPECT_LT(geometry::CompareRigs(report.rig, truth.rig).max_translation_m, 1e-6) << what;
    EXPECT_NEAR(report.rms_px, truth.rms_px, 1e-6) << what;
    ASSERT_FALSE(report.rotated.empty()) << what;
    EXPECT_TRUE(report.numbering.empty()) << what;
    EXPECT_TRUE(report.frames_conflict.empty()) << what << ": " << report.frames_conflict;
    const auto& reasons = report.verdict.reasons;
    EXPECT_TRUE(std::any_of(reasons.begin(), reasons.end(), [](const auto& r) { return r.code == "CAL-NUMBERING"; })) << what;
  }
}

/// A board of as many columns as rows, both even, whose images are numbered from any of four ends.
TEST(Numbering, QuarterTurnsOfSquareBoardsAreRotatedBack) {
  testing::SceneOptions scene;
  scene.num_cameras = 3, scene.noise_px = 0.1;
  scene.board = "chessboard:8x8:60mm";
  const CalibrateInput straight = testing::ToInput(testing::MakeScene(scene));
  const CalibrateReport truth = Solved(straight);
  ASSERT_EQ(truth.status, Status::kOk);
  EXPECT_TRUE(truth.rotated.empty());
  for (const bool grid : {false, true}) {
    CalibrateInput input = straight;
    if (grid) input.boards[0].kind = Board::Kind::kGrid;
    for (Detection& d : input.detections) {
      const int quarters = static_cast<int>(d.camera_idx * 7 + d.frame_idx * 5) % 11 % 4;
      for (int& id : d.corner_ids) id = RotatedCorner(id, 64, quarters);
    }
    const CalibrateReport report = Solved(input);
    ASSERT_EQ(report.status, Status::kOk) << report.message;
    EXPECT_LT(geometry::CompareRigs(report.rig, truth.rig).max_translation_m, 1e-6);
    EXPECT_NEAR(report.rms_px, truth.rms_px, 1e-6);
    EXPECT_TRUE(report.numbering.empty());
    EXPECT_GE(report.rotated.size(), 2u);
  }
}

TEST(Numbering, FourQuarterTurnsAreNone) {
  for (int id = 0; id < 64; ++id) {
    EXPECT_EQ(RotatedCorner(RotatedCorner(id, 64, 1), 64, 3), id);
    EXPECT_EQ(RotatedCorner(RotatedCorner(id, 64, 1), 64, 1), RotatedCorner(id, 64, 2));
  }
}

TEST(Numbering, OfOneCameraTheRotatedViewsAreCounted) {
  testing::SceneOptions scene;
  scene.num_cameras = 3, scene.noise_px = 0.1;
  const CalibrateReport report = Solved(Recording(scene, [](int c, int64_t f) { return c == 1 && f % 9 == 1; }));
  ASSERT_EQ(report.rotated.size(), 1u);
  EXPECT_EQ(report.rotated[0].camera, "cam1");
  EXPECT_EQ(report.rotated[0].num_views, 20);
  EXPECT_EQ(report.rotated[0].num_rotated, 7);
}

TEST(Numbering, HeldOutViewsAreRotatedToo) {
  testing::SceneOptions scene;
  scene.num_cameras = 3, scene.noise_px = 0.1;
  CalibrateOptions options = testing::PlainOptions();
  options.model = geometry::LensModel::kBrown4;
  options.holdout.step = 3, options.holdout.first = 2;
  const CalibrateReport report = Calibrate(Recording(scene, [](int c, int64_t) { return c == 2; }), options, RunContext());
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_EQ(report.rig_holdout_gross_fraction, 0);
  EXPECT_LT(report.rig_holdout_rms_px, 0.3);
}

/// With a board that does not move, either numbering fits: nothing is turned, and few boards are told of.
TEST(Numbering, ABoardThatStandsStillTurnsNothing) {
  testing::SceneOptions scene;
  scene.num_cameras = 2, scene.noise_px = 0.1;
  CalibrateInput input = Recording(scene, [](int c, int64_t) { return c == 1; });
  const std::vector<Detection> all = input.detections;
  input.detections.clear();
  for (const Detection& d : all) {
    if (d.frame_idx != 1) continue;
    for (int f = 0; f < 6; ++f) input.detections.push_back(d), input.detections.back().frame_idx = f;
  }
  const geometry::Rig lenses = testing::TruthRig(testing::MakeScene(scene));
  input.start = lenses, input.start->gauge = kLensesOnly;
  CalibrateOptions options = testing::PlainOptions();
  options.fix = {{HeldPart::What::kLenses, {}}};
  const CalibrateReport report = Calibrate(input, options, RunContext());
  EXPECT_TRUE(report.rotated.empty());
  EXPECT_NE(report.verdict.outcome(), Outcome::kPass);
}

/// Two frames are too few to say what is turned: the camera contradicts the others everywhere, and may keep no corner.
TEST(Numbering, OfTwoFramesNothingIsRotatedAndNothingPasses) {
  testing::SceneOptions scene;
  scene.num_cameras = 4, scene.noise_px = 0.1;
  for (const int frames : {1, 2}) {
    scene.num_frames = frames;
    const CalibrateReport report = Solved(Recording(scene, [](int c, int64_t) { return c == 2; }));
    EXPECT_TRUE(report.rotated.empty());
    EXPECT_NE(report.verdict.outcome(), Outcome::kPass);
  }
}

}  // namespace
}  // namespace mvstudio::calib
