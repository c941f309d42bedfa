#include <algorithm>
#include <cmath>

#include "calib/calibrate.h"
#include "geometry/rig/alignment.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

/// Calibration at the edges: every case has the truth, or what is known about it, as its oracle.
namespace mvstudio::calib {
namespace {

using geometry::LensModel;

CalibrateOptions Given(LensModel model) {
  CalibrateOptions options;
  options.model = model;
  options.holdout_folds = 0;
  return options;
}

CalibrateReport Solve(const Scene& scene, LensModel model) {
  return Calibrate(testing::ToInput(scene), Given(model), RunContext());
}

/// Pixels of all corners by the solved rig and its boards, frame after frame, camera after camera.
std::vector<Eigen::Vector2d> Pixels(const CalibrateReport& report, const Board& board, double scale = 1) {
  std::vector<Eigen::Vector2d> pixels;
  const Eigen::Matrix3Xd corners = CornersInBoard(board) * scale;
  for (const geometry::Rigid3& world_from_board : report.world_from_board) {
    for (const geometry::RigCamera& camera : report.rig.cameras) {
      for (Eigen::Index i = 0; i < corners.cols(); ++i)
        pixels.push_back(
            geometry::Project(camera.camera, camera.cam_from_world * (world_from_board * Eigen::Vector3d(corners.col(i)))).px);
    }
  }
  return pixels;
}

double LargestDistance(const std::vector<Eigen::Vector2d>& a, const std::vector<Eigen::Vector2d>& b) {
  EXPECT_EQ(a.size(), b.size());
  double largest = 0;
  for (size_t i = 0; i < std::min(a.size(), b.size()); ++i) largest = std::max(largest, (a[i] - b[i]).norm());
  return largest;
}

/// Never a clean result: a status, or a verdict with reasons.
void ExpectDoubted(const CalibrateReport& report, const std::string& what) {
  EXPECT_TRUE(report.status != Status::kOk || report.verdict.outcome() != Outcome::kPass) << what;
  if (report.status != Status::kOk) {
    EXPECT_FALSE(report.message.empty()) << what;
    EXPECT_EQ(report.verdict.outcome(), Outcome::kFail) << what;
  } else {
    EXPECT_FALSE(report.verdict.reasons.empty()) << what;
  }
}

// --- Exact data -----------------------------------------------------------------------------------------------------

class ZeroNoise : public ::testing::TestWithParam<LensModel> {};

TEST_P(ZeroNoise, RecoversTheTruth) {
  SceneOptions options;
  options.model = GetParam();
  options.num_frames = 30;
  options.focal_px = 240, options.near_m = 0.4, options.far_m = 0.64;  // up to 55 degrees off the axis: all terms count
  const Scene scene = MakeScene(options);
  const CalibrateReport report = Solve(scene, GetParam());
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_LT(report.rms_px, 1e-6);
  EXPECT_EQ(report.rejected_fraction, 0);
  const geometry::Rig truth = testing::TruthRig(scene);
  for (size_t c = 0; c < 2; ++c) {
    const geometry::RigCamera& found = report.rig.cameras[c];
    const Eigen::VectorXd error = found.camera.params - truth.cameras[c].camera.params;
    EXPECT_LT((error.array() / truth.cameras[c].camera.params.array().abs().max(1)).abs().maxCoeff(), 1e-6)
        << error.transpose();
    EXPECT_LT(geometry::RotationAngle(found.cam_from_world.rotation, truth.cameras[c].cam_from_world.rotation), 1e-6);
    EXPECT_LT((found.cam_from_world.translation - truth.cameras[c].cam_from_world.translation).norm(), 1e-6);
    ASSERT_TRUE(found.params_covariance.has_value());
    EXPECT_TRUE(found.params_covariance->allFinite()) << "no noise is no reason for NaN";
    EXPECT_LT(found.params_covariance->diagonal().maxCoeff(), 1e-6);
  }
}

std::vector<LensModel> ModelsWithFixedParams() {
  std::vector<LensModel> models;
  for (LensModel model : geometry::kAllLensModels) {
    if (model != LensModel::kSplined) models.push_back(model);
  }
  return models;
}

INSTANTIATE_TEST_SUITE_P(Lens, ZeroNoise, ::testing::ValuesIn(ModelsWithFixedParams()),
                         [](const auto& test) { return std::string(geometry::ToString(test.param)); });

// --- Sizes ----------------------------------------------------------------------------------------------------------

/// One camera with a long lens and boards so far away that they fill the image.
Scene LongLens(double focal_px, int width_px, int height_px, double noise_px) {
  SceneOptions options;
  options.num_cameras = 1;
  options.num_frames = 24;
  options.model = LensModel::kPinhole;
  Scene scene = MakeScene(options);
  geometry::Camera& camera = scene.truth.cameras[0];
  camera.width_px = width_px, camera.height_px = height_px;
  camera.params << focal_px, 1.002 * focal_px, 0.51 * width_px, 0.49 * height_px;
  const double farther = focal_px / 540 * 640 / width_px;
  const geometry::Rigid3 world_from_cam = geometry::Inverse(scene.truth.cam_from_world[0]);
  const Eigen::Vector3d center(0.24, 0.15, 0);
  for (geometry::Rigid3& pose : scene.truth.world_from_board) {
    geometry::Rigid3 cam_from_board = scene.truth.cam_from_world[0] * pose;
    Eigen::Vector3d center_in_cam = cam_from_board * center;
    center_in_cam.z() *= farther;
    cam_from_board.translation = center_in_cam - cam_from_board.rotation * center;
    pose = world_from_cam * cam_from_board;
  }
  testing::ObserveAll(&scene, noise_px, 77);
  return scene;
}

TEST(Extremes, FocalLengthOf1e5PxIsRecovered) {
  for (const auto& [width, height] : {std::pair(4000, 3000), std::pair(640, 480)}) {
    const Scene scene = LongLens(1e5, width, height, 0);
    ASSERT_GT(scene.detections.size(), 15u);
    const CalibrateReport report = Solve(scene, LensModel::kPinhole);
    ASSERT_EQ(report.status, Status::kOk) << width << ": " << report.message;
    EXPECT_NEAR(report.rig.cameras[0].camera.fx(), 1e5, 1) << width;
    EXPECT_LT(report.rms_px, 1e-6) << width;
  }
}

TEST(Extremes, FocalLengthOf1e5PxIsWithinItsUncertainty) {
  const Scene scene = LongLens(1e5, 4000, 3000, 0.1);
  const CalibrateReport report = Solve(scene, LensModel::kPinhole);
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  const auto& found = report.rig.cameras[0];
  ASSERT_TRUE(found.params_covariance.has_value());
  for (int i = 0; i < 4; ++i) {
    const double sigma = std::sqrt((*found.params_covariance)(i, i));
    EXPECT_LT(std::abs(found.camera.params[i] - scene.truth.cameras[0].params[i]), 4.5 * sigma) << "parameter " << i;
  }
}

/// Boards so far away that a square is one pixel wide.
Scene OnePixelSquares(double noise_px) {
  Scene scene = LongLens(540, 640, 480, 0);
  const geometry::Rigid3 world_from_cam = geometry::Inverse(scene.truth.cam_from_world[0]);
  for (geometry::Rigid3& pose : scene.truth.world_from_board) {
    geometry::Rigid3 cam_from_board = scene.truth.cam_from_world[0] * pose;
    cam_from_board.translation *= 0.06 * 540 / cam_from_board.translation.z();
    pose = world_from_cam * cam_from_board;
  }
  testing::ObserveAll(&scene, noise_px, 5);
  return scene;
}

TEST(Extremes, SquaresOfOnePixelAreExactOrDoubted) {
  const Scene exact = OnePixelSquares(0);
  ASSERT_EQ(exact.detections.size(), 24u);
  const CalibrateReport report = Solve(exact, LensModel::kPinhole);
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_NEAR(report.rig.cameras[0].camera.fx(), 540, 1e-3);
  const CalibrateReport noisy = Solve(OnePixelSquares(0.1), LensModel::kPinhole);
  ExpectDoubted(noisy, "a tenth of a pixel leaves the focal length open");
}

TEST(Extremes, MillimetresMetresAndKilometresGiveTheSamePixels) {
  SceneOptions options;
  options.num_cameras = 3;
  options.noise_px = 0.2;
  const Scene scene = MakeScene(options);
  const CalibrateReport metres = Solve(scene, LensModel::kBrown4);
  ASSERT_EQ(metres.status, Status::kOk) << metres.message;
  const auto wanted = Pixels(metres, scene.board);
  for (double scale : {1e-3, 1e3}) {
    Scene scaled = scene;
    scaled.board.square_m *= scale;
    const CalibrateReport report = Solve(scaled, LensModel::kBrown4);
    ASSERT_EQ(report.status, metres.status) << "scale " << scale << ": " << report.message;
    EXPECT_LT(LargestDistance(Pixels(report, scaled.board), wanted), 1e-9) << "scale " << scale;
    EXPECT_NEAR(report.rms_px, metres.rms_px, 1e-9) << "scale " << scale;
    EXPECT_EQ(report.num_corners, metres.num_corners);
    ASSERT_EQ(report.verdict.reasons.size(), metres.verdict.reasons.size() + 1);  // nobody prints such a board
    EXPECT_EQ(std::count_if(report.verdict.reasons.begin(), report.verdict.reasons.end(),
                            [](const auto& r) { return r.code == "CAL-UNIT"; }),
              1);
    for (int c = 1; c < 3; ++c) {
      const Eigen::Vector3d a = metres.rig.cameras[c].cam_from_world.translation * scale,
                            b = report.rig.cameras[c].cam_from_world.translation;
      EXPECT_LT((a - b).norm(), 1e-9 * a.norm()) << "camera " << c;
    }
  }
}

TEST(Extremes, AWorldWhoseOriginIs1e7MetresAwayShowsTheSamePixels) {
  SceneOptions options;
  options.num_cameras = 3;
  options.noise_px = 0.2;
  const Scene scene = MakeScene(options);
  CalibrateReport report = Solve(scene, LensModel::kBrown4);
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  const auto near = Pixels(report, scene.board);
  geometry::Rigid3 far_from_world;
  far_from_world.rotation = geometry::RotationExp(Eigen::Vector3d(0.4, -0.7, 1.1));
  far_from_world.translation = Eigen::Vector3d(6e6, -7e6, 4e6);
  for (auto& camera : report.rig.cameras) camera.cam_from_world = camera.cam_from_world * geometry::Inverse(far_from_world);
  for (auto& pose : report.world_from_board) pose = far_from_world * pose;
  // Coordinates of 1e7 m are rounded to 2e-9 m, and so are rotations times them: 600 px / 0.9 m times a few of these.
  EXPECT_LT(LargestDistance(Pixels(report, scene.board), near), 1e-4);
}

TEST(Extremes, AdjustmentInAWorldWhoseOriginIs1e7MetresAwayFindsTheSameOptimum) {
  SceneOptions options;
  options.num_cameras = 3;
  options.noise_px = 0.2;
  Scene scene = MakeScene(options);
  BundleOptions bundle;
  bundle.reject_outliers = false;
  double wanted = 0;
  for (double distance : {0.0, 1e7}) {
    geometry::Rigid3 far_from_world;
    far_from_world.translation = distance * Eigen::Vector3d(0.6, -0.7, 0.4);
    RigState state = scene.truth;
    for (auto& pose : state.cam_from_world) pose = pose * geometry::Inverse(far_from_world);
    for (auto& pose : state.world_from_board) pose = far_from_world * pose;
    std::vector<View> views = MakeViews({scene.board}, scene.detections, &state.frames);
    const BundleReport report = SolveBundle(&views, &state, bundle);
    EXPECT_EQ(report.status, Status::kOk) << distance << ": " << report.message;
    if (distance == 0) wanted = report.rms_px;
    EXPECT_NEAR(report.rms_px, wanted, 1e-6) << distance;
  }
}

}  // namespace
}  // namespace mvstudio::calib
