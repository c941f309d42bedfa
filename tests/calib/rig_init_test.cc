#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/bundle/bundle.h"
#include "calib/covariance/uncertainty.h"
#include "calib/lens/resection.h"
#include "calib/rig/init.h"
#include "core/error.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

using geometry::Rigid3;

/// Views of a true rig with the poses that single views give.
struct PlacedScene {
  Board board = ParseBoard("chessboard:9x6:60mm");
  RigState truth;
  std::vector<View> views;
  std::vector<Rigid3> cam_from_board;

  RigState Start() const {
    RigState state = truth;
    std::fill(state.cam_from_world.begin(), state.cam_from_world.end(), Rigid3());
    std::fill(state.rig_from_board.begin(), state.rig_from_board.end(), Rigid3());
    state.world_from_board.clear();
    return state;
  }
};

void AddCamera(PlacedScene* scene, const std::string& name, const Rigid3& cam_from_world, double focal_px = 500) {
  scene->truth.cameras.push_back(testing::MakeCamera(name, geometry::LensModel::kPinhole, focal_px));
  scene->truth.cam_from_world.push_back(cam_from_world);
}

void AddFrame(PlacedScene* scene, int64_t frame_idx, const Rigid3& world_from_board) {
  scene->truth.frames.push_back(frame_idx);
  scene->truth.world_from_board.push_back(world_from_board);
}

/// Sees all corners or nothing; true when it did.
bool See(PlacedScene* scene, int camera, int frame, int board, double noise_px, Rng* rng) {
  View view;
  view.camera_idx = camera, view.frame = frame, view.board = board;
  view.x_in_board = CornersInBoard(scene->board);
  view.px.resize(2, view.x_in_board.cols());
  view.warp_basis = WarpBasis(view.x_in_board);
  view.weights = Eigen::VectorXd::Ones(view.x_in_board.cols());
  const geometry::Projector projector(scene->truth.cameras[camera]);
  const Rigid3 cam_from_board = CamFromBoard(view, scene->truth);
  for (int i = 0; i < view.x_in_board.cols(); ++i) {
    const auto seen = projector.Project(cam_from_board * Eigen::Vector3d(view.x_in_board.col(i)));
    if (seen.status != Status::kOk || !geometry::InImage(scene->truth.cameras[camera], seen.px)) return false;
    view.corner_ids.push_back(i);
    view.px.col(i) = seen.px + noise_px * Eigen::Vector2d(rng->Normal(), rng->Normal());
  }
  const Resection resection = ResectPlane(scene->truth.cameras[camera], view);
  if (resection.status != Status::kOk) return false;
  scene->views.push_back(view);
  scene->cam_from_board.push_back(resection.cam_from_board);
  return true;
}

void SeeAll(PlacedScene* scene, double noise_px, uint64_t seed) {
  Rng rng(seed);
  const auto count = [](const auto& list) { return static_cast<int>(list.size()); };
  for (int f = 0; f < count(scene->truth.frames); ++f) {
    for (int c = 0; c < count(scene->truth.cameras); ++c) {
      for (int b = 0; b < count(scene->truth.rig_from_board); ++b) See(scene, c, f, b, noise_px, &rng);
    }
  }
}

/// Board whose middle is at `middle` in world, its printed side towards `eye`, turned by `turn` about its own axes.
Rigid3 FacingBoard(const Eigen::Vector3d& middle, const Eigen::Vector3d& eye, const Eigen::Vector3d& turn) {
  Rigid3 world_from_board = geometry::Inverse(testing::LookAt(eye, middle));
  world_from_board.rotation = world_from_board.rotation * geometry::RotationExp(turn);
  world_from_board.translation = middle - world_from_board.rotation * Eigen::Vector3d(0.24, 0.15, 0);
  return world_from_board;
}

Eigen::Vector3d RandomTurn(Rng* rng, double limit) {
  return {rng->Uniform(-limit, limit), rng->Uniform(-limit, limit), rng->Uniform(-limit, limit)};
}

/// Cameras on a circle of 0.2 m that look outwards; each board is between two neighbours.
PlacedScene Ring(int cameras, int frames_per_link, double noise_px, uint64_t seed) {
  PlacedScene scene;
  Rng rng(seed);
  const double step = 2 * M_PI / cameras;
  const auto out = [&](double at) { return Eigen::Vector3d(std::cos(at * step), std::sin(at * step), 0); };
  for (int c = 0; c < cameras; ++c) {
    AddCamera(&scene, "ring" + std::to_string(c), testing::LookAt(0.2 * out(c), 2 * out(c)), 250);
  }
  for (int k = 0; k < frames_per_link * cameras; ++k) {
    const Eigen::Vector3d middle =
        rng.Uniform(1.1, 1.4) * out(k % cameras + 0.5) + Eigen::Vector3d(0, 0, rng.Uniform(-0.1, 0.1));
    AddFrame(&scene, 2 * k, FacingBoard(middle, Eigen::Vector3d::Zero(), RandomTurn(&rng, 0.5)));
  }
  SeeAll(&scene, noise_px, seed + 100);
  return scene;
}

/// Largest error of the relative poses to camera `from`.
struct Errors {
  double rotation_rad = 0, center_m = 0;
};

Errors ErrorsOf(const PlacedScene& scene, const RigState& found, int from = 0) {
  Errors errors;
  for (size_t c = 0; c < scene.truth.cameras.size(); ++c) {
    const Rigid3 wanted = scene.truth.cam_from_world[c] * geometry::Inverse(scene.truth.cam_from_world[from]);
    const Rigid3 is = found.cam_from_world[c] * geometry::Inverse(found.cam_from_world[from]);
    errors.rotation_rad = std::max(errors.rotation_rad, geometry::RotationAngle(wanted.rotation, is.rotation));
    const Eigen::Vector3d shift = geometry::Inverse(wanted).translation - geometry::Inverse(is).translation;
    if (!(shift.norm() <= errors.center_m)) errors.center_m = shift.norm();
  }
  return errors;
}

TEST(RigInit, NoiseFreeRingToRounding) {
  const PlacedScene scene = Ring(8, 4, 0, 1);
  RigState state = scene.Start();
  const RigStart start = InitializeRig(scene.views, scene.cam_from_board, 3, &state);
  ASSERT_EQ(start.status, Status::kOk) << start.message;
  EXPECT_EQ(start.components.size(), 1u);
  EXPECT_EQ(start.component_frames, std::vector<int>{32});
  const Errors errors = ErrorsOf(scene, state, 3);
  EXPECT_LT(errors.rotation_rad, 1e-8);
  EXPECT_LT(errors.center_m, 1e-8);
  EXPECT_LT(start.median_px, 1e-5);
  EXPECT_TRUE(state.cam_from_world[3].translation.isZero(0));
  EXPECT_TRUE(state.cam_from_world[3].rotation.isApprox(Eigen::Quaterniond::Identity(), 0));
}

TEST(RigInit, ARingClosesBetterThanItsSpanningTree) {
  double averaged = 0, chained = 0;
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    const PlacedScene scene = Ring(8, 6, 0.5, seed);
    RigState state = scene.Start();
    const RigStart start = InitializeRig(scene.views, scene.cam_from_board, 0, &state);
    ASSERT_EQ(start.status, Status::kOk) << start.message;
    EXPECT_TRUE(start.averaged);
    EXPECT_LT(start.median_px, 1.5);
    const Errors errors = ErrorsOf(scene, state);
    EXPECT_LT(errors.rotation_rad, 0.02);
    EXPECT_LT(errors.center_m, 0.02);
    averaged += errors.center_m;
    // The tree alone, as the scene without the views of the last camera in the frames between it and camera 0.
    PlacedScene open = scene;
    for (size_t v = 0; v < open.views.size(); ++v) {
      if (open.views[v].camera_idx == 7 && open.views[v].frame % 8 == 7) open.views[v].weights.setZero();
    }
    RigState chain = open.Start();
    ASSERT_EQ(InitializeRig(open.views, open.cam_from_board, 0, &chain).status, Status::kOk);
    chained += ErrorsOf(open, chain).center_m;
  }
  EXPECT_LT(averaged, chained);
}

TEST(RigInit, TheOrderOfCamerasAndViewsDoesNotMatter) {
  const PlacedScene scene = Ring(6, 4, 0.3, 3);
  RigState state = scene.Start();
  ASSERT_EQ(InitializeRig(scene.views, scene.cam_from_board, 2, &state).status, Status::kOk);
  const std::vector<int> order = {4, 2, 5, 0, 3, 1};  // new camera i is old camera order[i]
  PlacedScene mixed = scene;
  for (int i = 0; i < 6; ++i) mixed.truth.cameras[i] = scene.truth.cameras[order[i]];
  for (View& view : mixed.views) {
    view.camera_idx = static_cast<int>(std::find(order.begin(), order.end(), view.camera_idx) - order.begin());
  }
  std::reverse(mixed.views.begin(), mixed.views.end());
  std::reverse(mixed.cam_from_board.begin(), mixed.cam_from_board.end());
  RigState other = mixed.Start();
  other.cam_from_world.resize(6);
  ASSERT_EQ(InitializeRig(mixed.views, mixed.cam_from_board, 1, &other).status, Status::kOk);
  for (int i = 0; i < 6; ++i) {
    const Rigid3 &a = state.cam_from_world[order[i]], &b = other.cam_from_world[i];
    EXPECT_LT(geometry::RotationAngle(a.rotation, b.rotation), 1e-12);
    EXPECT_LT((a.translation - b.translation).norm(), 1e-12);
  }
  for (size_t f = 0; f < state.frames.size(); ++f) {
    EXPECT_LT((state.world_from_board[f].translation - other.world_from_board[f].translation).norm(), 1e-12);
  }
}

/// Cameras beside each other on a wall, 0.4 m apart, one board between two neighbours.
TEST(RigInit, AChainOf64CamerasWithOneViewPerLink) {
  PlacedScene scene;
  Rng rng(5);
  for (int c = 0; c < 64; ++c) {
    const Eigen::Vector3d eye(0.4 * c, 0, 0);
    AddCamera(&scene, "wall" + std::to_string(c), testing::LookAt(eye, eye + Eigen::Vector3d(0, 1, 0)));
  }
  for (int c = 0; c + 1 < 64; ++c) {
    const Eigen::Vector3d eye(0.4 * c + 0.2, 0, 0);
    AddFrame(&scene, c, FacingBoard(eye + Eigen::Vector3d(0, 1.3, 0), eye, RandomTurn(&rng, 0.5)));
  }
  for (int f = 0; f < 63; ++f) {
    ASSERT_TRUE(See(&scene, f, f, 0, 0.1, &rng));
    ASSERT_TRUE(See(&scene, f + 1, f, 0, 0.1, &rng));
  }
  RigState state = scene.Start();
  const RigStart start = InitializeRig(scene.views, scene.cam_from_board, 0, &state);
  ASSERT_EQ(start.status, Status::kOk) << start.message;
  const Errors errors = ErrorsOf(scene, state);
  // A single pose errs by a few mrad at 0.1 px; errors add up like a random walk over the 63 links.
  EXPECT_LT(errors.rotation_rad, 63 * 0.005);
  EXPECT_LT(errors.center_m, 0.1 * 25.2);
  // What the views themselves say is met: only one link touches each of them.
  EXPECT_LT(start.median_px, 0.3);
}

TEST(RigInit, TwentyPercentWrongPosesDoNotMatter) {
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    PlacedScene scene = Ring(8, 10, 0.2, seed);
    RigState clean = scene.Start();
    ASSERT_EQ(InitializeRig(scene.views, scene.cam_from_board, 0, &clean).status, Status::kOk);
    Rng rng(seed + 9);
    for (size_t v = 0; v < scene.views.size(); v += 5) {
      scene.cam_from_board[v].rotation = geometry::RotationExp(RandomTurn(&rng, 2)) * scene.cam_from_board[v].rotation;
      scene.cam_from_board[v].translation += RandomTurn(&rng, 1);
    }
    RigState state = scene.Start();
    const RigStart start = InitializeRig(scene.views, scene.cam_from_board, 0, &state);
    ASSERT_EQ(start.status, Status::kOk) << start.message;
    const Errors without = ErrorsOf(scene, clean), with = ErrorsOf(scene, state);
    EXPECT_LT(with.rotation_rad, 3 * without.rotation_rad + 1e-3) << "seed " << seed;
    EXPECT_LT(with.center_m, 3 * without.center_m + 1e-3) << "seed " << seed;
  }
}

/// Boards on a stick, 0.8 m apart; each camera is in front of one of them and looks away from the others.
PlacedScene Apart(int boards, int frames, double noise_px, uint64_t seed, bool one_axis = false) {
  PlacedScene scene;
  Rng rng(seed);
  scene.truth.rig_from_board.clear();
  for (int b = 0; b < boards; ++b) {
    Rigid3 rig_from_board;
    rig_from_board.rotation = geometry::RotationExp(b == 0 ? Eigen::Vector3d::Zero() : RandomTurn(&rng, 0.2));
    rig_from_board.translation = Eigen::Vector3d(0.8 * b, 0.05 * b, 0);
    scene.truth.rig_from_board.push_back(rig_from_board);
    const Eigen::Vector3d eye(0.8 * b + 0.24, 0.15, -1.5);
    Rigid3 cam_from_world;
    cam_from_world.rotation = geometry::RotationExp(RandomTurn(&rng, 0.1));
    cam_from_world.translation = -(cam_from_world.rotation * eye);
    AddCamera(&scene, "cam" + std::to_string(b), cam_from_world);
  }
  scene.truth.board_warp_m.assign(boards, Eigen::Vector2d::Zero());
  const Eigen::Vector3d pivot(0.4 * (boards - 1) + 0.24, 0.15, 0);
  for (int f = 0; f < frames; ++f) {
    const Eigen::Vector3d turn =
        one_axis ? Eigen::Vector3d(rng.Uniform(-0.5, 0.5), 0, 0)
                 : Eigen::Vector3d(rng.Uniform(-0.5, 0.5), rng.Uniform(-0.35, 0.35), rng.Uniform(-0.2, 0.2));
    Rigid3 world_from_rig{geometry::RotationExp(turn), Eigen::Vector3d::Zero()};
    world_from_rig.translation = pivot - world_from_rig.rotation * pivot + RandomTurn(&rng, 0.05);
    AddFrame(&scene, 10 + f, world_from_rig);
  }
  for (int f = 0; f < frames; ++f) {
    for (int b = 0; b < boards; ++b) See(&scene, b, f, b, noise_px, &rng);
  }
  return scene;
}

TEST(RigInit, CamerasThatSeeDifferentBoardsAreLinkedByTheirMotion) {
  PlacedScene scene = Apart(2, 30, 0.2, 2);
  ASSERT_GT(scene.views.size(), 40u);
  RigState state = scene.Start();
  const RigStart start = InitializeRig(scene.views, scene.cam_from_board, 0, &state);
  ASSERT_EQ(start.status, Status::kOk) << start.message;
  EXPECT_EQ(start.board_components, (std::vector<std::vector<int>>{{0, 1}}));
  const Errors errors = ErrorsOf(scene, state);
  EXPECT_LT(errors.rotation_rad, 0.01);
  EXPECT_LT(errors.center_m, 0.02);
  EXPECT_LT(start.median_px, 0.5);
  // The start is good enough for the adjustment to reach the accuracy that it predicts.
  BundleOptions bundle;
  bundle.refine_intrinsics = false;
  const BundleReport solved = SolveBundle(&scene.views, &state, bundle);
  ASSERT_EQ(solved.status, Status::kOk) << solved.message;
  EXPECT_NEAR(solved.sigma_px, 0.2, 0.02);
  const RigCovariance covariance = ComputeCovariance(scene.views, state, bundle, solved.sigma_px);
  ASSERT_EQ(covariance.status, Status::kOk) << covariance.message;
  const Rigid3 wanted = scene.truth.cam_from_world[1] * geometry::Inverse(scene.truth.cam_from_world[0]);
  geometry::Vector6d error;
  error << geometry::RotationLog(state.cam_from_world[1].rotation * wanted.rotation.conjugate()),
      state.cam_from_world[1].translation - wanted.translation;
  EXPECT_LT(error.dot(covariance.cam_from_world[1].ldlt().solve(error)), 22.5) << "chi2 of 6, 99.9 %";
}

TEST(RigInit, BoardsThatTurnAboutOneAxisDoNotLink) {
  const PlacedScene scene = Apart(2, 30, 0.2, 2, true);
  RigState state = scene.Start();
  const RigStart start = InitializeRig(scene.views, scene.cam_from_board, 0, &state);
  EXPECT_EQ(start.status, Status::kDegenerate);
  EXPECT_EQ(start.components.size(), 2u);
  EXPECT_NE(start.message.find("axis"), std::string::npos) << start.message;
  EXPECT_NE(start.message.find("different boards"), std::string::npos) << start.message;
  EXPECT_LT(start.message.size(), 400u);
}

TEST(RigInit, TwoSimultaneousFramesDoNotLink) {
  const PlacedScene scene = Apart(2, 2, 0, 4);
  ASSERT_EQ(scene.views.size(), 4u);
  RigState state = scene.Start();
  const RigStart start = InitializeRig(scene.views, scene.cam_from_board, 0, &state);
  EXPECT_EQ(start.status, Status::kDegenerate);
  EXPECT_NE(start.message.find("only 2 of the 3"), std::string::npos) << start.message;
}

TEST(RigInit, ThreeBoardsApartAreLinkedOneByOne) {
  const PlacedScene scene = Apart(3, 40, 0, 6);
  RigState state = scene.Start();
  const RigStart start = InitializeRig(scene.views, scene.cam_from_board, 1, &state);
  ASSERT_EQ(start.status, Status::kOk) << start.message;
  const Errors errors = ErrorsOf(scene, state, 1);
  EXPECT_LT(errors.rotation_rad, 1e-7);
  EXPECT_LT(errors.center_m, 1e-7);
}

/// cam0 sees boards 0 and 1, cam1 sees 1 and 2, cam2 sees 2 only.
TEST(RigInit, BoardsLinkCamerasTransitively) {
  PlacedScene scene = Apart(3, 12, 0, 7);
  scene.truth.rig_from_board[1].translation.x() = 0.5, scene.truth.rig_from_board[2].translation.x() = 1.0;
  scene.views.clear(), scene.cam_from_board.clear();
  scene.truth.cam_from_world[0].translation.z() += 0.6;
  scene.truth.cam_from_world[1].translation.z() += 0.6;
  Rng rng(1);
  std::vector<std::vector<int>> seen(3, std::vector<int>(3, 0));
  for (int f = 0; f < 12; ++f) {
    for (const auto& [camera, board] : std::vector<std::pair<int, int>>{{0, 0}, {0, 1}, {1, 1}, {1, 2}, {2, 2}}) {
      const bool early = f < 6;  // cam2 and cam0 never see anything at the same time
      if (camera != 1 && (camera == 0) != early) continue;
      seen[camera][board] += See(&scene, camera, f, board, 0, &rng);
    }
  }
  ASSERT_GE(std::min({seen[0][0], seen[0][1], seen[1][1], seen[1][2], seen[2][2]}), 2);
  RigState state = scene.Start();
  const RigStart start = InitializeRig(scene.views, scene.cam_from_board, 0, &state);
  ASSERT_EQ(start.status, Status::kOk) << start.message;
  EXPECT_EQ(start.board_components, (std::vector<std::vector<int>>{{0, 1, 2}}));
  const Errors errors = ErrorsOf(scene, state);
  EXPECT_LT(errors.rotation_rad, 1e-8);
  EXPECT_LT(errors.center_m, 1e-8);
  for (int b = 1; b < 3; ++b) {
    const Rigid3 &is = state.rig_from_board[b], &wanted = scene.truth.rig_from_board[b];
    EXPECT_LT((is.translation - wanted.translation).norm(), 1e-8);
    EXPECT_LT(geometry::RotationAngle(is.rotation, wanted.rotation), 1e-8);
  }
  for (const View& view : scene.views) {
    const auto residuals = ResidualsOf(view, state.cameras[view.camera_idx], CamFromBoard(view, state));
    ASSERT_TRUE(residuals);
    EXPECT_LT(residuals->cwiseAbs().maxCoeff(), 1e-5);
  }
}

TEST(RigInit, GivenPosesDefineTheWorldAndLink) {
  PlacedScene scene = Ring(8, 4, 0.2, 8);
  // Without the links 0-7 and 3-4 the ring falls into two halves.
  for (View& view : scene.views) {
    if (view.frame % 8 == 7 || view.frame % 8 == 3) view.weights.setZero();
  }
  RigState state = scene.Start();
  EXPECT_EQ(InitializeRig(scene.views, scene.cam_from_board, 0, &state).components.size(), 2u);
  RigInitOptions options;
  options.known_cam_from_world.resize(8);
  for (int c : {1, 2, 5}) options.known_cam_from_world[c] = scene.truth.cam_from_world[c];
  state = scene.Start();
  const RigStart start = InitializeRig(scene.views, scene.cam_from_board, 0, &state, options);
  ASSERT_EQ(start.status, Status::kOk) << start.message;
  for (int c : {1, 2, 5}) {
    EXPECT_TRUE(state.cam_from_world[c].translation.isApprox(scene.truth.cam_from_world[c].translation, 0));
  }
  for (int c = 0; c < 8; ++c) {
    EXPECT_LT(geometry::RotationAngle(state.cam_from_world[c].rotation, scene.truth.cam_from_world[c].rotation), 0.02) << c;
    EXPECT_LT((state.cam_from_world[c].translation - scene.truth.cam_from_world[c].translation).norm(), 0.04) << c;
  }
  // A camera that saw nothing does not matter when its pose is given.
  AddCamera(&scene, "blind", testing::LookAt({5, 5, 5}, {0, 0, 0}));
  options.known_cam_from_world.push_back(scene.truth.cam_from_world.back());
  state = scene.Start();
  EXPECT_EQ(InitializeRig(scene.views, scene.cam_from_board, 0, &state, options).status, Status::kOk);
}

TEST(RigInit, DisconnectedGroupsAreNamedWithTheNearestFrames) {
  PlacedScene scene = Ring(8, 4, 0, 8);
  for (View& view : scene.views) {
    if (view.frame % 8 == 7 || view.frame % 8 == 3) view.weights.setZero();
  }
  RigState state = scene.Start();
  const RigStart start = InitializeRig(scene.views, scene.cam_from_board, 0, &state);
  EXPECT_EQ(start.status, Status::kDegenerate);
  EXPECT_EQ(start.components, (std::vector<std::vector<int>>{{0, 1, 2, 3}, {4, 5, 6, 7}}));
  EXPECT_EQ(start.component_frames, (std::vector<int>{12, 12}));
  ASSERT_TRUE(start.near_miss);
  // Frames are even numbers, two apart; those of the links 2-3 (k % 8 == 2) and 4-5 (k % 8 == 4) are 4 apart.
  EXPECT_EQ(std::abs(start.near_miss->frame_a - start.near_miss->frame_b), 4);
  const std::string near =
      "ring" + std::to_string(start.near_miss->camera_a) + " in frame " + std::to_string(start.near_miss->frame_a);
  EXPECT_NE(start.message.find(near), std::string::npos) << start.message;
  EXPECT_NE(start.message.find("{ring0, ring1, ring2, ring3}, {ring4, ring5, ring6, ring7} (12, 12 frames)"), std::string::npos)
      << start.message;
  EXPECT_LT(start.message.size(), 400u);
}

TEST(RigInit, ManyLongNamesStayShort) {
  PlacedScene scene = Ring(40, 1, 0, 8);
  for (size_t c = 0; c < scene.truth.cameras.size(); ++c) {
    scene.truth.cameras[c].name = std::string(120, 'x') + std::to_string(c);
  }
  for (View& view : scene.views) {
    if (view.frame != view.camera_idx) view.weights.setZero();
  }
  RigState state = scene.Start();
  const RigStart start = InitializeRig(scene.views, scene.cam_from_board, 0, &state);
  EXPECT_EQ(start.status, Status::kDegenerate);
  EXPECT_LT(start.message.size(), 400u) << start.message;
  EXPECT_EQ(start.message.find('\n'), std::string::npos);
}

TEST(RigInit, NothingSeenAndPosesThatAreNotFinite) {
  PlacedScene scene = Ring(4, 2, 0, 1);
  RigState state = scene.Start();
  EXPECT_EQ(InitializeRig({}, {}, 0, &state).status, Status::kTooFewViews);
  scene = Ring(8, 4, 0, 1);
  scene.cam_from_board[0].translation.x() = std::numeric_limits<double>::quiet_NaN();
  state = scene.Start();
  ASSERT_EQ(InitializeRig(scene.views, scene.cam_from_board, 0, &state).status, Status::kOk);
  EXPECT_LT(ErrorsOf(scene, state).center_m, 1e-8);
  EXPECT_THROW(InitializeRig(scene.views, {}, 0, &state), ContractViolation);
  EXPECT_THROW(InitializeRig(scene.views, scene.cam_from_board, 8, &state), ContractViolation);
}

/// Boards seen at different times by the same cameras have no place relative to each other; each gets the identity.
TEST(RigInit, BoardsNeverSeenTogetherStayApart) {
  PlacedScene scene = Ring(8, 4, 0, 1);
  scene.truth.rig_from_board.resize(2);
  scene.truth.board_warp_m.resize(2, Eigen::Vector2d::Zero());
  for (View& view : scene.views) view.board = view.frame % 2;
  RigState state = scene.Start();
  const RigStart start = InitializeRig(scene.views, scene.cam_from_board, 0, &state);
  ASSERT_EQ(start.status, Status::kOk) << start.message;
  EXPECT_EQ(start.board_components, (std::vector<std::vector<int>>{{0}, {1}}));
  EXPECT_LT(ErrorsOf(scene, state).center_m, 1e-8);
  EXPECT_LT(start.median_px, 1e-5);
}

}  // namespace
}  // namespace mvstudio::calib
