#include <cmath>

#include "calib/bundle/bundle.h"
#include "calib/keypoints/place.h"
#include "calib/lens/resection.h"
#include "calib/points/point_bundle.h"
#include "calib/points/point_resection.h"
#include "calib/rig/hand_eye.h"
#include "core/format.h"
#include "tests/calib/keypoint_support.h"
#include "tests/calib/synthetic.h"
#include "tests/digits/exact_squares.h"
#include "tests/geometry/exact_lens.h"
#include "tests/support/digits.h"
#include "tests/support/test.h"

/// Digits of poses: from points, from a board, hand and eye, between two cameras, and of the adjustments.
namespace mvstudio::calib {
namespace {

using geometry::Rigid3;
using geometry::testing::Vector2mp;
using geometry::testing::Vector3mp;
using mvstudio::testing::ExactSquares;

const char* const kTruth = "the pose itself";
const char* const kOptimum = "Gauss-Newton in MPFR, 120 digits";

DigitsCase Case(const std::string& what, const std::string& conditions, const std::string& oracle) {
  return {"Poses and adjustments", what, conditions, oracle};
}

/// Angle between the rotations, and distance of the camera centres as a share of `distance`: the larger.
double Apart(const Rigid3& found, const Rigid3& truth, double distance) {
  return std::max(geometry::RotationAngle(found.rotation, truth.rotation),
                  (geometry::Inverse(found).translation - geometry::Inverse(truth).translation).norm() / distance);
}

/// Clicks of `count` points in a cube of 1 unit, 3 units before one camera.
struct Clicked {
  std::vector<geometry::RigCamera> camera;  // one, at the identity
  Rigid3 truth;
  Eigen::Matrix3Xd points;
  std::vector<PointClick> clicks;
};

Clicked Click(int count, double unit, double focal_px, const Eigen::Vector3d& origin, double flat = 1) {
  Clicked scene;
  Rng rng(3);
  scene.camera.resize(1);
  scene.camera[0].camera = geometry::MakePinhole("cam", 640, 480, focal_px);
  scene.truth = testing::LookAt({unit * 1.5, -unit * 2.4, unit * 0.9}, Eigen::Vector3d::Zero());
  scene.points.resize(3, count);
  const double reach = unit * std::min(1.0, 300 / focal_px);
  for (int i = 0; i < count; ++i) {
    scene.points.col(i) =
        reach * Eigen::Vector3d(rng.Uniform(-0.8, 0.8), rng.Uniform(-0.8, 0.8), flat * rng.Uniform(-0.6, 0.6));
    const auto seen = geometry::Project(scene.camera[0].camera, scene.truth * Eigen::Vector3d(scene.points.col(i)));
    scene.clicks.push_back({0, i, seen.px});
  }
  scene.points.colwise() += origin;
  scene.truth.translation -= scene.truth.rotation * origin;
  return scene;
}

void RecordPnp(const std::string& conditions, const Clicked& scene, double distance, int expected) {
  const PointResection found = ResectFromPoints(scene.camera, scene.clicks, scene.points);
  ASSERT_EQ(found.status, Status::kOk) << conditions << ": " << found.message;
  RecordDigits(Case("pose from points (`ResectFromPoints`)", conditions, kTruth), expected,
               Apart(found.rig_from_world, scene.truth, distance));
}

TEST(PoseDigits, FromPoints) {
  const Eigen::Vector3d here = Eigen::Vector3d::Zero();
  for (const int count : {4, 6, 40, 520}) RecordPnp(Format("n = %d", count), Click(count, 1, 500, here), 3, 9);
  RecordPnp("n = 8, flat", Click(8, 1, 500, here, 0), 3, 9);
  for (const double unit : {1e-6, 1e-3, 1e3, 1e6})
    RecordPnp(Format("n = 12, unit %g m", unit), Click(12, unit, 500, here), 3 * unit, 9);
  for (const double focal : {1e3, 1e4}) RecordPnp(Format("n = 12, f = %g px", focal), Click(12, 1, focal, here), 3, 7);
  for (const double far : {1e3, 1e6, 1e9}) {  // the points are rounded to 1e-16 of it
    RecordPnp(Format("n = 12, origin %g m away", far), Click(12, 1, 500, far * Eigen::Vector3d(0.6, -0.7, 0.4)), 3,
              mvstudio::testing::DigitsOf(1e-14 * far));
  }
}

TEST(PoseDigits, FromPointsThatDoNotSay) {
  const char* const definition = "definition";
  Clicked scene = Click(8, 1, 500, Eigen::Vector3d::Zero());
  const auto status = [&](size_t count) {
    return ToString(ResectFromPoints(scene.camera,
                                     {scene.clicks.begin(), scene.clicks.begin() + static_cast<std::ptrdiff_t>(count)},
                                     scene.points)
                        .status);
  };
  RecordStatus(Case("pose from points (`ResectFromPoints`)", "n = 3", definition), "TooFewViews", status(3));
  for (int i = 0; i < 8; ++i) scene.points.col(i) = Eigen::Vector3d(0.1 * i, 0.05 * i, 0.02 * i);
  RecordStatus(Case("pose from points (`ResectFromPoints`)", "on a line", definition), "Degenerate", status(8));
}

View ViewOf(const geometry::Camera& camera, const Rigid3& pose, const char* text, double noise_px) {
  const Board board = ParseBoard(text);
  View view;
  view.x_in_board = CornersInBoard(board);
  view.px.resize(2, board.num_corners());
  view.weights = Eigen::VectorXd::Ones(board.num_corners());
  Rng rng(2);
  for (int i = 0; i < board.num_corners(); ++i) {
    view.corner_ids.push_back(i);
    view.px.col(i) = geometry::Project(camera, pose * Eigen::Vector3d(view.x_in_board.col(i))).px +
                     noise_px * Eigen::Vector2d(rng.Normal(), rng.Normal());
  }
  return view;
}

TEST(PoseDigits, FromABoard) {
  const Rigid3 truth{geometry::RotationExp({0.5, -0.3, 0.7}), {-0.1, -0.05, 0.6}};
  for (const geometry::LensModel model : geometry::ModelsSimplestFirst()) {
    const geometry::Camera camera = testing::MakeCamera("cam", model);
    const Resection found = ResectPlane(camera, ViewOf(camera, truth, "chessboard:9x6:30mm", 0));
    ASSERT_EQ(found.status, Status::kOk) << geometry::ToString(model);
    RecordDigits(
        Case("pose from a board (`ResectPlane`)", "`" + std::string(geometry::ToString(model)) + "`, 54 corners", kTruth), 9,
        Apart(found.cam_from_board, truth, 0.6));
  }
}

Vector3mp RotateExactly(const Vector3mp& w, const Vector3mp& x) {
  const Mp angle = w.norm();
  if (angle == 0) return x;
  const Vector3mp axis = w / angle;
  return x * cos(angle) + axis.cross(x) * sin(angle) + axis * (axis.dot(x) * (1 - cos(angle)));
}

/// The pose with a left perturbation (rotation, translation), applied to a point.
Vector3mp MoveExactly(const Rigid3& pose, const VectorXmp& delta, Eigen::Index at, const Vector3mp& x) {
  const Eigen::Quaternion<Mp> q(Mp(pose.rotation.w()), Mp(pose.rotation.x()), Mp(pose.rotation.y()), Mp(pose.rotation.z()));
  const Vector3mp rotated = q.normalized().toRotationMatrix() * x;
  return RotateExactly(delta.segment<3>(at), rotated) + pose.translation.cast<Mp>() + delta.segment<3>(at + 3);
}

/// Of a left perturbation about the world's origin, entries as shares of their standard deviations.
TEST(PoseDigits, CovarianceFromPoints) {
  for (const double far : {0.0, 1e3, 1e6}) {
    const Clicked scene = Click(12, 1, 500, far * Eigen::Vector3d(0.6, -0.7, 0.4));
    const PointResection found = ResectFromPoints(scene.camera, scene.clicks, scene.points);
    ASSERT_EQ(found.status, Status::kOk) << far;
    const ExactSquares exact = mvstudio::testing::SolveExactly(6, [&](const VectorXmp& delta) {
      VectorXmp r(2 * scene.points.cols());
      for (Eigen::Index i = 0; i < scene.points.cols(); ++i) {
        const Vector3mp x = MoveExactly(found.rig_from_world, delta, 0, scene.points.col(i).cast<Mp>());
        r.segment<2>(2 * i) =
            geometry::testing::ProjectExactly(scene.camera[0].camera, x) - scene.clicks[static_cast<size_t>(i)].px.cast<Mp>();
      }
      return r;
    });
    ASSERT_TRUE(exact.found);
    const auto covariance = mvstudio::testing::MatrixXmp(exact.information.inverse());
    WorstError worst;
    for (int i = 0; i < 36; ++i) {
      const Mp of_entry = sqrt(covariance(i / 6, i / 6) * covariance(i % 6, i % 6));
      worst.Add(((Mp(found.covariance(i / 6, i % 6)) - covariance(i / 6, i % 6)) / of_entry).convert_to<double>());
    }
    RecordDigits(Case("covariance of a pose from points", Format("n = 12, origin %g m away", far), kOptimum), 9, worst.value());
  }
}

/// How far the exact minimum lies from the solution, in standard deviations of the unknowns together, noise 1.
double InSigmas(const ExactSquares& exact, double sigma) {
  return sqrt(exact.moved.dot(exact.information * exact.moved)).convert_to<double>() / sigma;
}

/// The optimum of a noisy view, from the solution.
TEST(PoseDigits, RefinedPoseOfANoisyBoard) {
  const Rigid3 truth{geometry::RotationExp({0.5, -0.3, 0.7}), {-0.1, -0.05, 0.6}};
  const geometry::Camera camera = testing::MakeCamera("cam", geometry::LensModel::kBrown5);
  const View view = ViewOf(camera, truth, "chessboard:9x6:30mm", 0.3);
  const Resection found = ResectPlane(camera, view);
  ASSERT_EQ(found.status, Status::kOk);
  const ExactSquares exact = mvstudio::testing::SolveExactly(6, [&](const VectorXmp& delta) {
    VectorXmp r(2 * view.size());
    for (Eigen::Index i = 0; i < view.size(); ++i) {
      const Vector3mp x = MoveExactly(found.cam_from_board, delta, 0, view.x_in_board.col(i).cast<Mp>());
      r.segment<2>(2 * i) = geometry::testing::ProjectExactly(camera, x) - view.px.col(i).cast<Mp>();
    }
    return r;
  });
  ASSERT_TRUE(exact.found);
  RecordDigits(Case("refined pose, in its standard deviations", "54 corners, noise 0.3 px", kOptimum), 5, InSigmas(exact, 0.3));
  RecordDigits(Case("RMS of its residuals", "54 corners, noise 0.3 px", kOptimum), 9,
               found.rms_px / sqrt(exact.cost / 54).convert_to<double>() - 1);
}

/// Two cameras and three boards: two lenses of four parameters, a camera and three boards of six.
TEST(PoseDigits, BundleOfBoards) {
  testing::SceneOptions options;
  options.num_frames = 3;
  options.board = "chessboard:5x4:90mm";
  options.model = geometry::LensModel::kPinhole;
  options.noise_px = 0.2;
  testing::Scene scene = testing::MakeScene(options);
  RigState state = scene.truth;
  std::vector<View> views = MakeViews({scene.board}, scene.detections, &state.frames);
  BundleOptions bundle;
  bundle.reject_outliers = false;
  const BundleReport report = SolveBundle(&views, &state, bundle);
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  const int boards = static_cast<int>(state.frames.size()), unknowns = 8 + 6 + 6 * boards;
  const ExactSquares exact = mvstudio::testing::SolveExactly(unknowns, [&](const VectorXmp& delta) {
    std::vector<Mp> r;
    for (const View& view : views) {
      const int c = view.camera_idx;
      const VectorXmp params = state.cameras[c].params.cast<Mp>() + delta.segment<4>(4 * c);
      for (Eigen::Index i = 0; i < view.size(); ++i) {
        const Vector3mp in_world =
            MoveExactly(state.world_from_board[view.frame], delta, 14 + 6 * view.frame, view.x_in_board.col(i).cast<Mp>());
        const Vector3mp in_cam = MoveExactly(
            state.cam_from_world[c], c == 0 ? VectorXmp(VectorXmp::Zero(6)) : VectorXmp(delta.segment<6>(8)), 0, in_world);
        const Vector2mp px = geometry::testing::ProjectExactly(state.cameras[c], params, in_cam);
        for (int k = 0; k < 2; ++k) r.push_back(px[k] - Mp(view.px(k, i)));
      }
    }
    return VectorXmp(Eigen::Map<VectorXmp>(r.data(), static_cast<Eigen::Index>(r.size())));
  });
  ASSERT_TRUE(exact.found);
  const std::string where = Format("2 cameras, %d boards, %d corners, noise 0.2 px", boards, report.num_corners);
  RecordDigits(Case("bundle, all unknowns in their standard deviations", where, kOptimum), 4, InSigmas(exact, 0.2));
  RecordDigits(Case("bundle, RMS of its residuals", where, kOptimum), 9,
               report.rms_px / sqrt(exact.cost / report.num_corners).convert_to<double>() - 1);
}

/// Cameras around points; the first camera stays, and the distance to the second is known.
TEST(PoseDigits, BundleOfPoints) {
  constexpr int kCameras = 3, kPoints = 9;
  PointScene scene;
  std::vector<PointObservation> seen;
  Rng rng(6);
  scene.points = Eigen::Matrix3Xd::NullaryExpr(3, kPoints, [&] { return rng.Uniform(-0.8, 0.8); });
  for (int c = 0; c < kCameras; ++c) {
    scene.lenses.push_back(testing::MakeCamera("cam" + std::to_string(c), geometry::LensModel::kBrown2, 500));
    scene.lens_of_camera.push_back(c);
    scene.cam_from_world.push_back(
        testing::LookAt({3 * std::sin(0.7 * c), -3 * std::cos(0.7 * c), 0.3 * c - 0.5}, Eigen::Vector3d::Zero()));
    for (int p = 0; p < kPoints; ++p) {
      const auto px = geometry::Project(scene.lenses[c], scene.cam_from_world[c] * Eigen::Vector3d(scene.points.col(p))).px;
      seen.push_back({c, p, px + 0.3 * Eigen::Vector2d(rng.Normal(), rng.Normal()), 1});
    }
  }
  PointBundleOptions options;
  options.fix_camera = {true, true, false};
  options.reject_outliers = false;
  options.cost_tolerance = 1e-13;
  const PointBundleReport report = SolvePointBundle(&scene, &seen, options);
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  const ExactSquares exact = mvstudio::testing::SolveExactly(6 + 3 * kPoints, [&](const VectorXmp& delta) {
    VectorXmp r(2 * static_cast<Eigen::Index>(seen.size()));
    for (size_t i = 0; i < seen.size(); ++i) {
      const int c = seen[i].camera_idx, p = seen[i].point_idx;
      const Vector3mp x = scene.points.col(p).cast<Mp>() + delta.segment<3>(6 + 3 * p);
      const Vector3mp in_cam = MoveExactly(scene.cam_from_world[c], c < 2 ? VectorXmp(VectorXmp::Zero(6)) : delta, 0, x);
      r.segment<2>(2 * static_cast<Eigen::Index>(i)) =
          geometry::testing::ProjectExactly(scene.lenses[c], in_cam) - seen[i].px.cast<Mp>();
    }
    return r;
  });
  ASSERT_TRUE(exact.found);
  const std::string where = "3 cameras, 9 points, noise 0.3 px";
  RecordDigits(Case("bundle of points, all unknowns in their standard deviations", where, kOptimum), 4, InSigmas(exact, 0.3));
  RecordDigits(Case("bundle of points, its cost", where, kOptimum), 9, report.cost / exact.cost.convert_to<double>() - 1);
}

Rigid3 RandomPose(Rng* rng, double angle, double length) {
  const Eigen::Vector3d turn(rng->Normal(), rng->Normal(), rng->Normal()), shift(rng->Normal(), rng->Normal(), rng->Normal());
  return {geometry::RotationExp(angle * turn), length * shift};
}

/// Exact pairs of a device whose lengths are about `unit` metres; with `axis` the hand turns about it alone.
std::vector<HandEyePair> Pairs(int count, double unit, Rigid3* a_from_b,
                               const Eigen::Vector3d& axis = Eigen::Vector3d::Zero()) {
  Rng rng(5);
  *a_from_b = RandomPose(&rng, 1, unit);
  const Rigid3 q_from_p = RandomPose(&rng, 0.7, 0.5 * unit);
  std::vector<HandEyePair> pairs;
  for (int i = 0; i < count; ++i) {
    Rigid3 a_from_p = RandomPose(&rng, 0.4, 0.2 * unit);
    if (!axis.isZero()) a_from_p.rotation = geometry::RotationExp(rng.Normal() * axis);
    a_from_p.translation.z() += unit;
    pairs.push_back({a_from_p, geometry::Inverse(*a_from_b) * a_from_p * geometry::Inverse(q_from_p)});
  }
  return pairs;
}

TEST(PoseDigits, HandAndEye) {
  const std::string what = "hand and eye (`SolveHandEye`)";
  Rigid3 truth;
  const auto record = [&](const std::string& conditions, const std::vector<HandEyePair>& pairs, double unit) {
    const HandEye found = SolveHandEye(pairs);
    ASSERT_EQ(found.status, Status::kOk) << conditions << ": " << found.message;
    RecordDigits(Case(what, conditions, kTruth), 11, Apart(found.a_from_b, truth, unit));
  };
  for (const int count : {3, 30, 520}) record(Format("n = %d", count), Pairs(count, 1, &truth), 1);
  for (const double unit : {1e-9, 1e-3, 1e3, 1e9}) record(Format("n = 12, unit %g m", unit), Pairs(12, unit, &truth), unit);
  const char* const definition = "definition";
  const auto status = [](const std::vector<HandEyePair>& pairs) { return ToString(SolveHandEye(pairs).status); };
  RecordStatus(Case(what, "n = 2", definition), "TooFewViews", status(Pairs(2, 1, &truth)));
  RecordStatus(Case(what, "turns about one axis", definition), "Degenerate", status(Pairs(25, 1, &truth, {0.6, 0, 0.8})));
  std::vector<HandEyePair> bad = Pairs(5, 1, &truth);
  bad[3].a_from_p.translation.y() = std::nan("");
  RecordStatus(Case(what, "a coordinate is NaN", definition), "NonFiniteInput", status(bad));
}

/// Cameras from joints without noise. It is a start for an adjustment, and promises a few degrees.
TEST(PoseDigits, RelativePose) {
  for (const int cameras : {2, 4}) {
    const geometry::Rig rig = testing::PeopleRig(cameras);
    testing::PeopleOptions options;
    options.num_joints = 1, options.num_frames = 150, options.noise_px = 0, options.outlier_fraction = 0;
    const auto placed = PlaceAnew(rig, testing::JointsOf(rig, testing::FilmPeople(rig, options)));
    ASSERT_TRUE(placed) << cameras;
    WorstError worst;
    const Rigid3 world_from_found = geometry::Inverse(placed->cameras[0].cam_from_world);
    for (int c = 1; c < cameras; ++c) {
      const Rigid3 found = placed->cameras[c].cam_from_world * world_from_found,
                   truth = rig.cameras[c].cam_from_world * geometry::Inverse(rig.cameras[0].cam_from_world);
      worst.Add(geometry::RotationAngle(found.rotation, truth.rotation));
      worst.Add(found.translation.normalized().cross(truth.translation.normalized()).norm());
    }
    RecordDigits(Case("relative pose (`PlaceAnew`)", Format("%d cameras, 150 joints, a start", cameras), kTruth), 1,
                 worst.value());
  }
}

}  // namespace
}  // namespace mvstudio::calib
