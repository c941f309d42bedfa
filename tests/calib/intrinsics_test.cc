#include "calib/lens/intrinsics.h"

#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

std::vector<View> ViewsOf(const testing::Scene& scene, std::vector<int64_t>* frames) {
  return MakeViews({scene.board}, scene.detections, frames);
}

TEST(GuessFocal, ClosedFormIsExactForAPinholeAtTheCentre) {
  SceneOptions options;
  options.num_cameras = 1;
  testing::Scene scene = MakeScene(options);
  scene.truth.cameras[0] = geometry::MakePinhole("c", 640, 480, 700);
  scene.detections.clear();
  Rng rng(1);
  for (int f = 0; f < 6; ++f) scene.detections.push_back(testing::Observe(scene, 0, f, 0, &rng));
  std::vector<int64_t> frames;
  const FocalGuess guess = GuessFocal(ViewsOf(scene, &frames), 640, 480);
  ASSERT_EQ(guess.status, Status::kOk);
  EXPECT_NEAR(guess.focal_px, 700, 1e-6);
}

TEST(GuessFocal, FrontoParallelBoardsAreDegenerate) {
  SceneOptions options;
  options.num_cameras = 1;
  options.max_tilt_rad = 0;
  options.model = geometry::LensModel::kPinhole;
  std::vector<int64_t> frames;
  EXPECT_EQ(GuessFocal(ViewsOf(MakeScene(options), &frames), 640, 480).status, Status::kDegenerate);
  EXPECT_EQ(GuessFocal({}, 640, 480).status, Status::kTooFewViews);
}

class CalibrateMonoTest : public ::testing::TestWithParam<geometry::LensModel> {};

TEST_P(CalibrateMonoTest, RecoversNoiseFreeIntrinsics) {
  SceneOptions options;
  options.num_cameras = 1;
  options.num_frames = 12;
  options.model = GetParam();
  const auto scene = MakeScene(options);
  geometry::Camera start = scene.truth.cameras[0];
  start.params.setZero();
  std::vector<int64_t> frames;
  const std::vector<View> views = ViewsOf(scene, &frames);
  const MonoSolution solution = CalibrateMono(start, views, BundleOptions());
  ASSERT_EQ(solution.status, Status::kOk) << solution.message;
  EXPECT_LT(solution.bundle.rms_px, 1e-7);
  const Eigen::VectorXd error = solution.state.cameras[0].params - scene.truth.cameras[0].params;
  EXPECT_LT((error.array() / scene.truth.cameras[0].params.array().abs().max(1.0)).abs().maxCoeff(), 1e-6) << error.transpose();
}

INSTANTIATE_TEST_SUITE_P(Models, CalibrateMonoTest,
                         ::testing::Values(geometry::LensModel::kPinhole, geometry::LensModel::kBrown1,
                                           geometry::LensModel::kBrown2, geometry::LensModel::kBrown4,
                                           geometry::LensModel::kBrown5, geometry::LensModel::kKannalaBrandt4));

TEST(CalibrateMono, NothingAndNanHaveAStatus) {
  const auto scene = MakeScene({});
  const geometry::Camera camera = scene.truth.cameras[0];
  EXPECT_EQ(CalibrateMono(camera, {}, BundleOptions()).status, Status::kTooFewViews);
  std::vector<int64_t> frames;
  std::vector<View> views = ViewsOf(scene, &frames);
  views[2].px(0, 0) = std::nan("");
  EXPECT_EQ(CalibrateMono(camera, views, BundleOptions()).status, Status::kNonFiniteInput);
}

TEST(WithModel, KeepsWhatBothHave) {
  const geometry::Camera brown5 = testing::MakeCamera("c", geometry::LensModel::kBrown5);
  EXPECT_EQ(WithModel(brown5, geometry::LensModel::kBrown2).params, brown5.params.head(6));
  const geometry::Camera rational = WithModel(brown5, geometry::LensModel::kRational8);
  EXPECT_EQ(rational.params.head(9), brown5.params);
  EXPECT_EQ(rational.params.tail(3).norm(), 0);
}

TEST(WithModel, BetweenFamiliesKeepsTheImage) {
  const geometry::Camera brown = testing::MakeCamera("c", geometry::LensModel::kBrown2);
  const geometry::Camera fisheye = WithModel(brown, geometry::LensModel::kKannalaBrandt4);
  for (double x : {-0.5, 0.0, 0.3}) {
    const Eigen::Vector3d point(x, 0.2, 1);
    EXPECT_LT((geometry::Project(brown, point).px - geometry::Project(fisheye, point).px).norm(), 0.5);
  }
}

/// A wide fisheye lens, 200 degrees across, of which nothing is known but the size of its images.
TEST(CalibrateMono, FindsAFisheyeLensFromNoGuess) {
  geometry::Camera truth{"fish", geometry::LensModel::kKannalaBrandt4, 1000, 1000, Eigen::VectorXd::Zero(8), {}};
  truth.params << 285, 286, 505, 492, -0.01, 0.004, -0.001, 0;
  const Board board = ParseBoard("chessboard:9x6:60mm");
  Rng rng(6);
  std::vector<Detection> detections;
  for (int f = 0; f < 40; ++f) {
    const Eigen::Vector3d axis = Eigen::Vector3d(rng.Normal(), rng.Normal(), 0).normalized();
    geometry::Rigid3 cam_from_board;
    const double off_axis = 1.5 * rng.Uniform();  // of the board's centre, rad
    cam_from_board.rotation = geometry::RotationExp(off_axis * axis) *
                              geometry::RotationExp(Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal()) * 0.3);
    cam_from_board.translation = geometry::RotationExp(off_axis * axis) * Eigen::Vector3d(0, 0, 0.45) -
                                 cam_from_board.rotation * Eigen::Vector3d(0.24, 0.15, 0);
    Detection d;
    d.frame_idx = f;
    std::vector<Eigen::Vector2d> points;
    const Eigen::Matrix3Xd corners = CornersInBoard(board);
    for (int i = 0; i < corners.cols(); ++i) {
      const auto p = geometry::Project(truth, cam_from_board * Eigen::Vector3d(corners.col(i)));
      if (p.status != Status::kOk || !geometry::InImage(truth, p.px)) continue;
      d.corner_ids.push_back(i);
      points.push_back(p.px + 0.05 * Eigen::Vector2d(rng.Normal(), rng.Normal()));
    }
    if (points.size() < 12) continue;
    d.points_px.resize(2, static_cast<Eigen::Index>(points.size()));
    for (size_t i = 0; i < points.size(); ++i) d.points_px.col(static_cast<Eigen::Index>(i)) = points[i];
    detections.push_back(d);
  }
  std::vector<int64_t> frames;
  const MonoSolution solution = CalibrateMono(geometry::MakePinhole("fish", 1000, 1000, 1000),
                                              MakeViews({board}, detections, &frames), BundleOptions(), false);
  ASSERT_EQ(solution.status, Status::kOk) << solution.message;
  EXPECT_EQ(solution.state.cameras[0].model, geometry::LensModel::kKannalaBrandt4);
  EXPECT_LT(solution.bundle.rms_px, 0.08);
  EXPECT_NEAR(solution.state.cameras[0].fx(), 285, 0.5);
}

}  // namespace
}  // namespace mvstudio::calib
