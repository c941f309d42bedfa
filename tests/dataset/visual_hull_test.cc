#include "dataset/masks/visual_hull.h"

#include <cmath>
#include <limits>

#include "core/error.h"
#include "tests/dataset/dataset_test_util.h"
#include "tests/support/test.h"

namespace mvstudio::dataset {
namespace {

const Eigen::Vector3d kCentre(0.1, -0.05, 1.0);
constexpr double kRadius = 0.3;

/// Cameras in a ring of 3 m that look at the centre, every other one with a distorted lens.
std::vector<geometry::RigCamera> Ring(int count) {
  std::vector<geometry::RigCamera> cameras;
  for (int c = 0; c < count; ++c) {
    geometry::RigCamera camera;
    camera.camera = geometry::MakePinhole("c" + std::to_string(c), 200, 200, 400);
    if (c % 2) {
      camera.camera.model = geometry::LensModel::kBrown2;
      camera.camera.params.conservativeResize(6);
      camera.camera.params[4] = -0.2, camera.camera.params[5] = 0.05;
    }
    const double angle = 2 * M_PI * c / count + 0.1;
    const Eigen::Vector3d at = kCentre + Eigen::Vector3d(3 * std::cos(angle), 3 * std::sin(angle), c % 2 ? 1.0 : -0.3);
    Eigen::Matrix3d axes;
    const Eigen::Vector3d z = (Eigen::Vector3d(0, 0, 1) - at).normalized(), x = Eigen::Vector3d(0, 0, -1).cross(z).normalized();
    axes << x.transpose(), z.cross(x).transpose(), z.transpose();
    camera.cam_from_world.rotation = Eigen::Quaterniond(axes);
    camera.cam_from_world.translation = -(axes * at);
    cameras.push_back(camera);
  }
  return cameras;
}

/// A pixel is the sphere's when its ray, through the exact inverse of the lens, meets it.
Image SphereSilhouette(const geometry::RigCamera& camera, const Eigen::Vector3d& centre, double radius) {
  Image mask(camera.camera.width_px, camera.camera.height_px, 1, 0);
  const geometry::Projector projector(camera.camera);
  const Eigen::Vector3d x = camera.cam_from_world * centre;
  for (int v = 0; v < mask.height; ++v) {
    for (int u = 0; u < mask.width; ++u) {
      const geometry::Unprojection ray = projector.Unproject({double(u), double(v)});
      if (ray.status == Status::kOk && ray.ray_in_cam.cross(x).norm() <= radius) *mask.Pixel(u, v) = 255;
    }
  }
  return mask;
}

struct Studio {
  std::vector<geometry::RigCamera> cameras;
  std::vector<Image> masks;
  std::vector<HullView> Views() const {
    std::vector<HullView> views;
    for (size_t c = 0; c < cameras.size(); ++c) views.push_back({&cameras[c], &masks[c]});
    return views;
  }
};

Studio SphereStudio(int count) {
  Studio studio{Ring(count), {}};
  for (const auto& camera : studio.cameras) studio.masks.push_back(SphereSilhouette(camera, kCentre, kRadius));
  return studio;
}

const HullBox kBox{Status::kOk, kCentre, 0.5};

/// For what does not need the finest cells.
HullOptions Coarse() {
  HullOptions options;
  options.voxel_m = 0.016;
  return options;
}

TEST(VisualHull, ExactSilhouettesAgree) {
  const Studio studio = SphereStudio(8);
  const VisualHull hull = CarveHull(studio.Views(), kBox);
  ASSERT_EQ(hull.status, Status::kOk);
  EXPECT_LE(hull.voxel_m, 0.01);
  for (const HullAgreement& a : hull.cameras) {
    EXPECT_LT(a.outside, 1e-3);
    EXPECT_LT(a.missing, 0.03);  // the hull of seven cones is larger than the sphere
    EXPECT_LT(a.blame, 1e-3);
  }
  const double sphere = 4.0 / 3 * M_PI * std::pow(kRadius, 3);
  EXPECT_GT(hull.volume_m3, 0.99 * sphere);
  EXPECT_LT(hull.volume_m3, 1.25 * sphere);
}

TEST(VisualHull, MoreCamerasMakeItSmaller) {
  double before = 1e9;
  for (const int count : {3, 6, 12}) {
    const Studio studio = SphereStudio(count);
    const VisualHull hull = CarveHull(studio.Views(), kBox, Coarse());
    EXPECT_LT(hull.volume_m3, before);
    before = hull.volume_m3;
  }
}

TEST(VisualHull, NamesTheCameraWhoseMaskIsWrong) {
  const Studio right = SphereStudio(6);
  for (const double radius : {0.22, 0.38}) {  // too small, too large
    Studio studio = right;
    studio.masks[2] = SphereSilhouette(studio.cameras[2], kCentre, radius);
    HullSummary summary;
    summary.Add(CarveHull(studio.Views(), kBox, Coarse()));
    EXPECT_EQ(summary.Disagreeing(0.05), std::vector<size_t>{2}) << radius;
  }
  HullSummary summary;
  summary.Add(CarveHull(right.Views(), kBox, Coarse()));
  EXPECT_TRUE(summary.Disagreeing(0.05).empty());
}

TEST(VisualHull, OneWrongMaskDoesNotForbidWhatOthersSee) {
  Studio studio = SphereStudio(6);
  studio.masks[2] = SphereSilhouette(studio.cameras[2], kCentre, 0.1);
  const VisualHull hull = CarveHull(studio.Views(), kBox, Coarse());
  const Image possible = PossiblePixels(hull, studio.cameras[0], 2.0);
  int lost = 0;
  for (size_t i = 0; i < possible.pixels.size(); ++i) lost += studio.masks[0].pixels[i] && !possible.pixels[i];
  EXPECT_EQ(lost, 0);
}

TEST(VisualHull, BoxesCoverTheBody) {
  const Studio studio = SphereStudio(4);
  const HullBox box = BoxOfMasks(studio.Views());
  ASSERT_EQ(box.status, Status::kOk);
  EXPECT_LT((box.centre - kCentre).norm(), 0.02);
  EXPECT_GT(box.half_m, kRadius);
  EXPECT_LT(box.half_m, 0.6);
  const HullBox of_joints = BoxOfJoints({{0, StandingPerson(2.0)}});
  EXPECT_NEAR(of_joints.centre.x(), 2.0, 1e-9);
  EXPECT_GT(of_joints.half_m, 0.9);
}

TEST(VisualHull, DegenerateInputGetsAStatus) {
  const Studio studio = SphereStudio(4);
  EXPECT_EQ(CarveHull({}, kBox).status, Status::kTooFewViews);
  EXPECT_EQ(CarveHull({studio.Views()[0]}, kBox).status, Status::kTooFewViews);

  Studio empty = studio;
  for (Image& mask : empty.masks) mask = Image(200, 200, 1, 0);
  EXPECT_EQ(CarveHull(empty.Views(), kBox).status, Status::kTooFewViews);
  EXPECT_EQ(BoxOfMasks(empty.Views()).status, Status::kTooFewViews);

  Coco19Pose nobody = StandingPerson(0);
  nobody.x_in_world.setConstant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(BoxOfJoints({{0, nobody}}).status, Status::kTooFewViews);
  EXPECT_EQ(CarveHull(studio.Views(), BoxOfJoints({})).status, Status::kTooFewViews);
  const HullBox infinite{Status::kOk, kCentre, std::numeric_limits<double>::infinity()};
  EXPECT_EQ(CarveHull(studio.Views(), infinite).status, Status::kNonFiniteInput);

  Studio apart = studio;  // two halves of the ring that see different people
  for (size_t c = 0; c < 4; ++c)
    apart.masks[c] = SphereSilhouette(apart.cameras[c], kCentre + Eigen::Vector3d(0, 0, c < 2 ? 0.33 : -0.33), 0.08);
  const VisualHull nothing = CarveHull(apart.Views(), kBox);
  EXPECT_EQ(nothing.status, Status::kDegenerate);
  for (const HullAgreement& a : nothing.cameras) EXPECT_EQ(a.outside, 1.0);

  Studio same{{studio.cameras[0], studio.cameras[0]}, {studio.masks[0], studio.masks[0]}};
  EXPECT_EQ(BoxOfMasks(same.Views()).status, Status::kLowParallax);

  const Image wrong(10, 10, 1, 255);
  EXPECT_THROW(CarveHull({{&studio.cameras[0], &wrong}, studio.Views()[1]}, kBox), ContractViolation);
}

TEST(VisualHull, AnEmptyMaskIsNamedAndDoesNotCarve) {
  Studio studio = SphereStudio(5);
  studio.masks[3] = Image(200, 200, 1, 0);
  const VisualHull hull = CarveHull(studio.Views(), kBox);
  ASSERT_EQ(hull.status, Status::kOk);
  EXPECT_EQ(hull.cameras[3].missing, 1.0);
  for (const size_t c : {0, 1, 2, 4}) EXPECT_LT(hull.cameras[c].outside, 1e-3);
}

TEST(VisualHull, CellsAreBounded) {
  const Studio studio = SphereStudio(3);
  HullOptions options;
  options.voxel_m = 1e-4;
  options.most_cells = 20000;
  const VisualHull hull = CarveHull(studio.Views(), kBox, options);
  EXPECT_LE(hull.cells.size(), 20000u);
  EXPECT_GT(hull.voxel_m, 1e-4);
  EXPECT_EQ(hull.status, Status::kOk);
}

}  // namespace
}  // namespace mvstudio::dataset
