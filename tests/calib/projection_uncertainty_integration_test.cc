#include <cmath>
#include <limits>
#include <map>
#include <string>

#include "calib/corners/corner_files.h"
#include "calib/covariance/projection_uncertainty.h"
#include "calib/lens/intrinsics.h"
#include "calib/rig/board_metrics.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

/// Against figures that mrcal 2.2 gave for the same corner files. Its solution rejects other corners and estimates its noise
/// differently, hence the bounds.
namespace mvstudio::calib {
namespace {

struct Stereo {
  std::vector<Board> boards;
  std::vector<View> views;
  RigState state;
  BundleOptions options;
  BundleReport solved;
};

/// Each camera alone, the right one placed by the first frame that both see, then all together with a bent board.
Stereo Solve(const std::string& path, geometry::LensModel model) {
  CornerFileOptions read;
  read.board = ParseBoard("chessboard:9x6:25mm");
  read.cameras = {{"left", "left", ".jpg"}, {"right", "right", ".jpg"}};
  read.sizes = {{"", 640, 480}};
  const CornerFile file = ReadCornerFile(path, read);
  Stereo stereo;
  stereo.boards = file.boards;
  stereo.views = MakeViews(file.boards, file.detections, &stereo.state.frames);
  std::vector<std::map<int, geometry::Rigid3>> cam_from_board(2);
  for (int c = 0; c < 2; ++c) {
    geometry::Camera camera = geometry::MakePinhole(file.cameras[c].name, 640, 480, 500);
    camera.model = model, camera.params.conservativeResize(geometry::NumParams(model));
    camera.params.tail(geometry::NumDistortionParams(model)).setZero();
    std::vector<View> own;
    for (const View& view : stereo.views) {
      if (view.camera_idx == c) own.push_back(view), own.back().camera_idx = 0;
    }
    const MonoSolution mono = CalibrateMono(camera, own, BundleOptions());
    EXPECT_EQ(mono.status, Status::kOk) << mono.message;
    for (size_t v = 0; v < own.size(); ++v) cam_from_board[c][own[v].frame] = mono.state.world_from_board[v];
    stereo.state.cameras.push_back(mono.state.cameras[0]);
  }
  geometry::Rigid3 right_from_left;
  for (const auto& [frame, pose] : cam_from_board[1]) {
    if (cam_from_board[0].count(frame)) right_from_left = pose * geometry::Inverse(cam_from_board[0][frame]);
  }
  stereo.state.cam_from_world = {geometry::Rigid3(), right_from_left};
  for (int f = 0; f < static_cast<int>(stereo.state.frames.size()); ++f) {
    stereo.state.world_from_board.push_back(
        cam_from_board[0].count(f) ? cam_from_board[0][f] : geometry::Inverse(right_from_left) * cam_from_board[1][f]);
  }
  stereo.options.refine_warp = true;
  stereo.solved = SolveBundle(&stereo.views, &stereo.state, stereo.options);
  EXPECT_EQ(stereo.solved.status, Status::kOk) << stereo.solved.message;
  return stereo;
}

ProjectionUncertainty Uncertainty(const Stereo& s, double sigma_px) { return {s.views, s.state, s.options, sigma_px}; }

/// At mrcal's own estimate of the noise. With k3 free, k4 adds nothing to a lens whose k3 … k6 are 0: -r^2 (1 + k1 r^2 + k2
/// r^4) is a sum of what k1, k2 and k3 do.
TEST(ProjectionUncertaintyOfRecordings, AgreesWithMrcalInStereo) {
  MVS_NEEDS_DATA("opencv_stereo");
  constexpr double kSigmaPx = 0.1624, kRange = 0.4;
  const Stereo lean = Solve(mvstudio::testing::DataRoot() + "/opencv_stereo/corners-sb.vnl", geometry::LensModel::kBrown4);
  Stereo rich = lean;
  for (geometry::Camera& camera : rich.state.cameras) {
    camera.model = geometry::LensModel::kRational8;
    camera.params.conservativeResize(12);
    camera.params.tail(4).setZero();
  }
  const auto of_lean = Uncertainty(lean, kSigmaPx), of_rich = Uncertainty(rich, kSigmaPx);
  const double centre = of_lean.PixelCovariance(0, {319.5, 239.5}, kRange).worst_px();
  const double corner = of_lean.PixelCovariance(0, {20, 20}, kRange).worst_px();
  RecordProperty("centre_px", std::to_string(centre));
  RecordProperty("corner_px", std::to_string(corner));
  EXPECT_NEAR(centre / 0.0234, 1, 0.05);
  EXPECT_NEAR(corner / 1.48, 1, 0.3);
  EXPECT_EQ(of_rich.PixelCovariance(0, {20, 20}, kRange).status, Status::kDegenerate);
}

TEST(ProjectionUncertaintyOfRecordings, AgreesWithMrcalOnAWideLens) {
  MVS_NEEDS_DATA("mrcal_figueroa");
  CornerFileOptions read;
  read.board = ParseBoard("grid:10x10:77mm");
  read.sizes = {{"", 6016, 4016}};
  const CornerFile file = ReadCornerFile(mvstudio::testing::DataRoot() + "/mrcal_figueroa/corners-cam0.vnl", read);
  RigState state;
  std::vector<View> views = MakeViews(file.boards, file.detections, &state.frames);
  double sum = 0, count = 0;
  for (const View& view : views) sum += view.weights.sum(), count += static_cast<double>(view.size());
  for (View& view : views) view.weights *= count / sum;
  geometry::Camera camera = geometry::MakePinhole("cam0", 6016, 4016, 2000);
  camera.model = geometry::LensModel::kRational8;
  camera.params.conservativeResize(12);
  camera.params.tail(8).setZero();
  MonoSolution mono = CalibrateMono(camera, views, BundleOptions());
  ASSERT_EQ(mono.status, Status::kOk) << mono.message;
  BundleOptions options;
  options.refine_warp = true;
  const BundleReport solved = SolveBundle(&mono.views, &mono.state, options);
  ASSERT_EQ(solved.status, Status::kOk) << solved.message;
  EXPECT_NEAR(solved.sigma_px / 0.551, 1, 0.15);
  const ProjectionUncertainty uncertainty(mono.views, mono.state, options, 0.551);
  struct Expected {
    double range_m, centre_px, edge_px;
  };
  for (const Expected& e : {Expected{1, 0.016, 0.087}, Expected{5, 0.030, 0.117},
                            Expected{std::numeric_limits<double>::infinity(), 0.035, 0.125}}) {
    const Eigen::Vector2d middle(3007.5, 2007.5);
    EXPECT_NEAR(uncertainty.PixelCovariance(0, middle, e.range_m).worst_px() / e.centre_px, 1, 0.1) << e.range_m;
    const double edge = uncertainty.PixelCovariance(0, {1.95 * middle.x(), middle.y()}, e.range_m).worst_px();
    EXPECT_NEAR(edge / e.edge_px, 1, 0.2) << e.range_m;
  }
}

/// Triangulated 25 mm squares, nothing rejected: mrcal's solutions give rms .388 and median .085 mm (classic), .267 and .076
/// (SB).
TEST(BoardMetricsOfRecordings, AgreeWithMrcal) {
  MVS_NEEDS_DATA("opencv_stereo");
  const std::string folder = mvstudio::testing::DataRoot() + "/opencv_stereo/";
  for (const char* name : {"corners-classic.vnl", "corners-sb.vnl"}) {
    const Stereo s = Solve(folder + name, geometry::LensModel::kBrown4);
    const BoardMetrics m = ComputeBoardMetrics(s.boards, s.views, s.state);
    const bool classic = name[8] == 'c';
    EXPECT_NEAR(m.edge_rms_mm / (classic ? 0.388 : 0.267), 1, 0.05);
    EXPECT_NEAR(m.edge_median_mm / (classic ? 0.085 : 0.076), 1, 0.1);
    EXPECT_LT(std::abs(m.edge_bias_mm), 3 * m.edge_rms_mm / std::sqrt(m.num_edges));  // none that could be told from chance
  }
}

}  // namespace
}  // namespace mvstudio::calib
