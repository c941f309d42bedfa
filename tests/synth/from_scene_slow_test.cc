#include <cstdio>
#include <cstdlib>

#include "calib/points/from_scene.h"
#include "core/error.h"
#include "core/random.h"
#include "core/units.h"
#include "dataset/footage/image_io.h"
#include "synth/plate.h"
#include "synth/textured_room.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::synth {
namespace {

using geometry::Rig;

/// Eight cameras around a room that look across it, the lens bent as a cheap one is.
Rig MakeRig() {
  Rig rig;
  for (int c = 0; c < 8; ++c) {
    geometry::RigCamera camera;
    camera.camera = geometry::MakePinhole("cam" + std::to_string(c), 960, 720, 580);
    camera.camera.model = geometry::LensModel::kBrown2;
    camera.camera.params.conservativeResizeLike(Eigen::VectorXd::Zero(6));
    camera.camera.params.tail<2>() << -0.12, 0.03;
    const double angle = 2 * kPi * c / 8 + 0.2;
    const Eigen::Vector3d eye(3.2 * std::cos(angle), 2.7 * std::sin(angle), 1.5 + 0.25 * (c % 3)),
        target(-0.8 * std::cos(angle), -0.8 * std::sin(angle), 1.2);
    const Eigen::Vector3d z = (target - eye).normalized(), x = z.cross(Eigen::Vector3d::UnitZ()).normalized();
    Eigen::Matrix3d r;
    r << x.transpose(), z.cross(x).transpose(), z.transpose();
    camera.cam_from_world.rotation = Eigen::Quaterniond(r);
    camera.cam_from_world.translation = -(r * eye);
    rig.cameras.push_back(camera);
  }
  return rig;
}

/// Marks on the walls and the floor, clicked with half a pixel of noise.
calib::KnownPoints MakeMarks(const Rig& rig, const TexturedRoom& room) {
  Rng rng(5);
  calib::KnownPoints known;
  known.gauge.kind = geometry::RigGauge::Kind::kPoints;
  known.sigma_px = 0.5;
  known.x_in_world.resize(3, 10);
  for (int i = 0; i < 10; ++i) {
    Eigen::Vector3d x(rng.Uniform(-0.45, 0.45) * room.size_m.x(), rng.Uniform(-0.45, 0.45) * room.size_m.y(),
                      rng.Uniform(0.2, 2.2));
    const int face = i % 5;
    if (face < 2) x.x() = (face == 0 ? -0.5 : 0.5) * room.size_m.x();
    if (face == 2 || face == 3) x.y() = (face == 2 ? -0.5 : 0.5) * room.size_m.y();
    if (face == 4) x.z() = 0;
    known.x_in_world.col(i) = x;
    known.names.push_back("mark" + std::to_string(i));
    for (const geometry::RigCamera& camera : rig.cameras) {
      const geometry::Projection p = geometry::Project(camera.camera, camera.cam_from_world * x);
      if (p.status != Status::kOk || !geometry::InImage(camera.camera, p.px)) continue;
      known.clicks.push_back({camera.camera.name, i, p.px + 0.5 * Eigen::Vector2d(rng.Normal(), rng.Normal())});
    }
  }
  return known;
}

struct Errors {
  double max_deg = 0, max_mm = 0, max_focal = 0, max_mahalanobis = 0;
};

Errors Compare(const Rig& found, const Rig& truth) {
  Errors errors;
  for (const geometry::RigCamera& camera : found.cameras) {
    const geometry::RigCamera& t = truth.cameras[truth.Find(camera.camera.name)];
    geometry::Vector6d delta;
    delta.head<3>() = geometry::RotationLog(camera.cam_from_world.rotation * t.cam_from_world.rotation.conjugate());
    delta.tail<3>() = camera.cam_from_world.translation - t.cam_from_world.translation;
    errors.max_deg = std::max(errors.max_deg, RadToDeg(delta.head<3>().norm()));
    errors.max_mm = std::max(errors.max_mm, 1e3 * (camera.CenterInWorld() - t.CenterInWorld()).norm());
    errors.max_focal = std::max(errors.max_focal, std::abs(camera.camera.fx() / t.camera.fx() - 1));
    if (camera.cam_from_world_covariance && !camera.cam_from_world_covariance->isZero(0))
      errors.max_mahalanobis =
          std::max(errors.max_mahalanobis, delta.dot(camera.cam_from_world_covariance->ldlt().solve(delta)));
  }
  return errors;
}

void Print(const char* name, const calib::FromSceneReport& r, const Errors& e) {
  std::printf(
      "%s: %zu cameras, %d points, %d features kept, %d rejected, feature sigma %.3f px (colmap %.3f px rms), worst errors "
      "%.4f deg %.2f mm, focal %.3f %%, variances x %.2f by %d clusters, Mahalanobis^2 %.1f\n",
      name, r.rig.cameras.size(), r.num_points, r.bundle.num_observations, r.bundle.num_rejected, r.feature_sigma_px,
      r.colmap_rms_px, e.max_deg, e.max_mm, 100 * e.max_focal, r.clusters.factor, r.clusters.num_clusters, e.max_mahalanobis);
}

calib::ColmapOptions Colmap() {
  calib::ColmapOptions options;
  options.max_features = 3000;
  return options;
}

/// A squared Mahalanobis distance of a pose that is exceeded three times in ten thousand.
constexpr double kUnlikely = 25;

class FromScene : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TempDir;
    truth_ = MakeRig();
    const RayColor color = [](const auto& origin, const auto& direction) { return room_.Color(origin, direction); };
    for (const geometry::RigCamera& camera : truth_.cameras) {
      const std::string path = *folder_ / (camera.camera.name + ".png");
      dataset::WriteImage(RenderPlate(color, LensRays(camera, 2), 3, 2), path);
      images_.push_back({camera.camera.name, path, camera.camera, true});
    }
  }
  static void TearDownTestSuite() { delete folder_; }

  static TempDir* folder_;
  static TexturedRoom room_;
  static Rig truth_;
  static std::vector<calib::SceneImage> images_;
};
TempDir* FromScene::folder_ = nullptr;
TexturedRoom FromScene::room_;
Rig FromScene::truth_;
std::vector<calib::SceneImage> FromScene::images_;

#define MVS_NEEDS_COLMAP()                                   \
  if (std::system("command -v colmap >/dev/null 2>&1") != 0) \
  GTEST_SKIP() << "needs the program colmap (Debian: apt install colmap)"

TEST_F(FromScene, KnownLensesAndMarks) {
  MVS_NEEDS_COLMAP();
  const calib::ColmapScene scene = calib::RunColmap(images_, *folder_ / "known", Colmap(), {});
  calib::SceneScale scale;
  scale.points = MakeMarks(truth_, room_);
  const calib::FromSceneReport report = calib::AdjustScene(scene, images_, scale, {}, {});
  const Errors errors = Compare(report.rig, truth_);
  Print("known lenses, marks", report, errors);
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_TRUE(report.missing.empty());
  for (const std::string& gross : report.gross) ADD_FAILURE() << gross;
  EXPECT_LT(errors.max_deg, 0.05);
  EXPECT_LT(errors.max_mm, 5);
  EXPECT_LT(errors.max_mahalanobis, kUnlikely);
}

TEST_F(FromScene, UnknownLensesAndADistance) {
  MVS_NEEDS_COLMAP();
  std::vector<calib::SceneImage> images = images_;
  for (calib::SceneImage& image : images) image.lens = calib::GuessLens(image.camera, 960, 720), image.lens_known = false;
  const calib::ColmapScene scene = calib::RunColmap(images, *folder_ / "unknown", Colmap(), {});
  calib::SceneScale scale;
  const double distance = (truth_.cameras[0].CenterInWorld() - truth_.cameras[4].CenterInWorld()).norm();
  scale.distance = calib::SceneScale::Distance{"cam0", "cam4", distance, 0};
  const calib::FromSceneReport report = calib::AdjustScene(scene, images, scale, {}, {});
  Rig truth = truth_;
  for (geometry::RigCamera& camera : truth.cameras)
    camera.cam_from_world = camera.cam_from_world * geometry::Inverse(truth_.cameras[0].cam_from_world);
  const Errors errors = Compare(report.rig, truth);
  Print("unknown lenses, distance", report, errors);
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_TRUE(report.missing.empty());
  EXPECT_LT(errors.max_deg, 0.2);
  EXPECT_LT(errors.max_mm, 20);
  EXPECT_LT(errors.max_focal, 0.005);
  EXPECT_FALSE(report.own_lenses) << "the cameras have one lens";
  EXPECT_LT(errors.max_mahalanobis, kUnlikely);
}

TEST_F(FromScene, MissingProgramSaysSo) {
  calib::ColmapOptions options;
  options.program = "no-such-colmap";
  EXPECT_THROW(calib::RunColmap(images_, *folder_ / "none", options, {}), MissingToolError);
}

}  // namespace
}  // namespace mvstudio::synth
