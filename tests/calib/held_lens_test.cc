#include <algorithm>

#include "calib/calibrate.h"
#include "calib/lens/smooth_error.h"
#include "geometry/rig/alignment.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

/// Rigs whose lenses are held and whose poses come from a single view of a board.
namespace mvstudio::calib {
namespace {

struct Recording {
  CalibrateInput input;
  geometry::Rig truth;
};

/// One view that all cameras share, tilted; `seed` chooses noise and place.
Recording OneView(uint64_t seed, int num_cameras = 3) {
  testing::SceneOptions options;
  options.num_cameras = num_cameras, options.noise_px = 0.15, options.seed = seed;
  const testing::Scene scene = testing::MakeScene(options);
  Recording recording{testing::ToInput(scene), testing::TruthRig(scene)};
  auto& all = recording.input.detections;
  std::map<int64_t, int> seen;
  for (const Detection& d : all) seen[d.frame_idx] += d.num_corners() == 54;
  int64_t best = 0;
  for (const auto& [frame, count] : seen) {
    if (count == num_cameras) best = frame;
  }
  all.erase(std::remove_if(all.begin(), all.end(), [&](const Detection& d) { return d.frame_idx != best; }), all.end());
  recording.input.start = recording.truth;
  recording.input.start->gauge = kLensesOnly;
  return recording;
}

CalibrateReport Solve(const CalibrateInput& input) {
  CalibrateOptions options = testing::PlainOptions();
  options.fix = {{HeldPart::What::kLenses, {}}};
  return Calibrate(input, options, RunContext());
}

/// Whether the verdict has the code; with a name, of that camera.
bool Says(const CalibrateReport& report, const std::string& code, const std::string& name = "") {
  const auto& reasons = report.verdict.reasons;
  return std::any_of(reasons.begin(), reasons.end(),
                     [&](const Notice& reason) { return reason.code == code && reason.text.find(name) != std::string::npos; });
}

TEST(HeldLens, ARightRigFromOneViewWarnsOfWhatIsNotKnown) {
  for (const uint64_t seed : {1, 2, 3}) {
    const Recording recording = OneView(seed);
    const CalibrateReport report = Solve(recording.input);
    ASSERT_EQ(report.status, Status::kOk) << report.message;
    EXPECT_LT(geometry::CompareRigs(report.rig, recording.truth).max_translation_m, 5e-3);
    EXPECT_EQ(report.verdict.outcome(), Outcome::kWarn) << seed;
    EXPECT_TRUE(Says(report, "CAL-NOHOLDOUT", "no other view confirms it"));
    EXPECT_FALSE(Says(report, "CAL-HELD")) << seed;
    EXPECT_FALSE(Says(report, "CAL-FEWVIEWS") || Says(report, "CAL-LOWCOV"));
    for (const CameraReport& camera : report.cameras) {
      EXPECT_TRUE(camera.lens_held);
      EXPECT_LT(camera.rms_px / camera.smooth_rms_px, 1.3) << seed << " " << camera.name;
      EXPECT_NEAR(camera.holdout_rms_px, 0.15 * std::sqrt(2), 0.1) << seed << " " << camera.name;
    }
  }
}

TEST(HeldLens, AKickedLensFails) {
  for (const uint64_t seed : {4, 5, 6}) {
    Recording recording = OneView(seed);
    geometry::Camera& lens = recording.input.start->cameras[1].camera;
    lens.params[4] += 1;  // k1: as of another lens
    const CalibrateReport report = Solve(recording.input);
    ASSERT_EQ(report.status, Status::kOk) << report.message;
    EXPECT_EQ(report.verdict.outcome(), Outcome::kFail) << seed;
    EXPECT_TRUE(Says(report, "CAL-HELD", "cam1")) << seed << ": " << report.cameras[1].rms_px << " px";
    EXPECT_FALSE(Says(report, "CAL-HELD", "cam0")) << seed;
  }
}

/// Rows and columns of other lengths than described.
TEST(HeldLens, AWrongBoardFails) {
  for (const uint64_t seed : {4, 5, 6}) {
    Recording recording = OneView(seed);
    Board& board = recording.input.boards[0];
    Eigen::Matrix3Xd corners = CornersInBoard(board);
    corners.row(0) *= 1.1;
    board = Board();
    board.kind = Board::Kind::kPoints, board.points = corners;
    const CalibrateReport report = Solve(recording.input);
    ASSERT_EQ(report.status, Status::kOk) << report.message;
    EXPECT_EQ(report.verdict.outcome(), Outcome::kFail) << seed;
    EXPECT_TRUE(Says(report, "CAL-HELD")) << seed << ": " << report.cameras[0].rms_px << " px";
  }
}

TEST(HeldLens, OfManyViewsNothingIsMissing) {
  testing::SceneOptions options;
  options.num_cameras = 2, options.noise_px = 0.15;
  const testing::Scene scene = testing::MakeScene(options);
  CalibrateInput input = testing::ToInput(scene);
  input.start = testing::TruthRig(scene), input.start->gauge = kLensesOnly;
  const CalibrateReport report = Solve(input);
  EXPECT_FALSE(Says(report, "CAL-NOHOLDOUT") || Says(report, "CAL-HELD"));
  CalibrateInput own = input;
  own.start.reset();
  const CalibrateReport free = Calibrate(own, testing::PlainOptions(), RunContext());
  EXPECT_FALSE(free.cameras[0].lens_held);
  EXPECT_TRUE(std::isnan(free.cameras[0].smooth_rms_px));
}

/// Residuals of noise with a smooth part on top, larger than the noise.
TEST(SmoothError, IsTheNoise) {
  testing::SceneOptions options;
  options.noise_px = 0.2;
  const testing::Scene scene = testing::MakeScene(options);
  std::vector<int64_t> frames;
  std::vector<View> views = MakeViews({scene.board}, scene.detections, &frames);
  for (const double smooth_px : {0.0, 3.0}) {
    Rng rng(2);
    std::vector<Eigen::Matrix2Xd> residuals;
    for (const View& view : views) {
      residuals.emplace_back(2, view.size());
      for (Eigen::Index i = 0; i < view.size(); ++i) {
        const Eigen::Vector2d x = view.x_in_board.col(i).head<2>();
        residuals.back().col(i) << smooth_px * x.x() * x.y() * x.y() + 0.2 * rng.Normal(),
            smooth_px * x.y() + 0.2 * rng.Normal();
      }
    }
    EXPECT_NEAR(SmoothErrorPx(views, residuals, 0), 0.2 * std::sqrt(2), 0.02) << smooth_px;
    EXPECT_TRUE(std::isnan(SmoothErrorPx(views, residuals, 7)));
    std::vector<View> few = views;
    for (View& view : few) view.weights.tail(view.size() - 20).setZero();
    EXPECT_TRUE(std::isnan(SmoothErrorPx(few, residuals, 0)));
  }
}

}  // namespace
}  // namespace mvstudio::calib
