#include "stages/calib/film_gain.h"

#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::stages {
namespace {

/// Boards in the middle of the images alone; then the boards that were proposed, filmed with the same noise.
TEST(FilmGain, ProposedBoardsGainWhatWasPredicted) {
  calib::testing::SceneOptions scene_options;
  scene_options.num_cameras = 2, scene_options.num_frames = 20, scene_options.noise_px = 0.3;
  scene_options.model = geometry::LensModel::kBrown2, scene_options.arc_rad = 0.2;
  scene_options.near_m = 1.2, scene_options.far_m = 1.8, scene_options.seed = 3;
  calib::testing::Scene scene = calib::testing::MakeScene(scene_options);
  calib::CalibrateInput input = calib::testing::ToInput(scene);
  calib::CalibrateOptions options = calib::testing::PlainOptions();
  options.motions = false;
  const calib::CalibrateReport first = calib::Calibrate(input, options, {});
  ASSERT_EQ(first.status, Status::kOk) << first.message;
  const std::vector<FilmGain> gains = PredictGain(first, input.boards);
  ASSERT_FALSE(gains.empty());
  Rng rng(5);
  int64_t frame = 1000;
  for (const FilmGain& gain : gains) {
    EXPECT_LT(gain.after_px, 0.7 * gain.before_px);
    for (const geometry::Rigid3& pose : gain.cam_from_board) {
      const Eigen::Matrix3Xd corners = calib::CornersInBoard(input.boards[0]);
      calib::Detection seen;
      seen.camera_idx = gain.camera_idx, seen.frame_idx = frame++;
      seen.points_px.resize(2, corners.cols());
      for (Eigen::Index i = 0; i < corners.cols(); ++i) {
        const auto projection = geometry::Project(scene.truth.cameras[gain.camera_idx], pose * Eigen::Vector3d(corners.col(i)));
        seen.points_px.col(i) = projection.px + 0.3 * Eigen::Vector2d(rng.Normal(), rng.Normal());
        seen.corner_ids.push_back(static_cast<int>(i));
      }
      input.detections.push_back(seen);
    }
  }
  const calib::CalibrateReport second = calib::Calibrate(input, options, {});
  ASSERT_EQ(second.status, Status::kOk) << second.message;
  for (const FilmGain& gain : gains) {
    const double reached = second.uncertainty.cameras[static_cast<size_t>(gain.camera_idx)].corner_px;
    EXPECT_NEAR(reached / gain.after_px, 1, 0.3) << gain.before_px << " px before, " << reached << " px reached";
  }
}

}  // namespace
}  // namespace mvstudio::stages
