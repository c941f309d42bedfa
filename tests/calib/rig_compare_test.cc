#include "calib/check/rig_compare.h"

#include <cmath>

#include "core/error.h"
#include "tests/geometry/lens_samples.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

using geometry::Camera;
using geometry::LensModel;

Camera Lens() { return geometry::testing::MakeLens(LensModel::kBrown4, {-0.28, 0.09, 0.0011, -0.0017}); }

TEST(Projection, SameLensIsNoDifference) {
  for (const Camera& lens : geometry::testing::OrdinaryLenses()) {
    const ProjectionDiff diff = CompareProjection(lens, lens);
    EXPECT_EQ(diff.status, Status::kOk) << lens.name;
    ASSERT_EQ(diff.ranges.size(), 3u);
    for (const auto& at : diff.ranges) EXPECT_LT(at.max_px, 1e-8) << lens.name << " at " << at.range_m;
    EXPECT_LT(diff.rotation_rad, 1e-9) << lens.name;
  }
}

/// A lens whose own frame is turned and moved, as a calibration may have it: the same lens with a pose that makes up for it. A
/// shift of the principal point is nearly a small rotation; what is left of it is of second order.
TEST(Projection, ImpliedMotionTakesOutAShiftOfThePrincipalPoint) {
  const Camera reference = geometry::MakePinhole("a", 1280, 960, 4000);
  Camera camera = reference;
  camera.params[2] += 2;
  ProjectionDiffOptions options;
  options.implied = false;
  const ProjectionDiff raw = CompareProjection(camera, reference, options);
  for (const auto& at : raw.ranges) {
    EXPECT_NEAR(at.rms_px, 2, 1e-9);
    EXPECT_NEAR(at.centre_px, 2, 1e-9);
  }
  EXPECT_EQ(raw.rotation_rad, 0);
  const ProjectionDiff implied = CompareProjection(camera, reference);
  EXPECT_LT(implied.ranges[0].rms_px, 0.05);
  // The shift is the rotation times 1 + (x / f)^2, on average 1 + (640 / 4000)^2 / 3.
  EXPECT_NEAR(implied.rotation_rad, std::atan(2.0 / 4000) / (1 + 0.16 * 0.16 / 3), 2e-6);
}

/// A difference that no rotation explains: a focal length 1 % longer. At infinity the pixel at radius r moves by 0.01 r.
TEST(Projection, FocalLengthIsNotExplainedAway) {
  const Camera reference = geometry::MakePinhole("a", 1281, 961, 1000);
  Camera camera = reference;
  camera.params.head<2>() *= 1.01;
  ProjectionDiffOptions options;
  options.ranges_m = {std::numeric_limits<double>::infinity()};
  const ProjectionDiff diff = CompareProjection(camera, reference, options);
  ASSERT_EQ(diff.ranges.size(), 1u);
  EXPECT_LT(diff.rotation_rad, 1e-9);
  EXPECT_NEAR(diff.ranges[0].max_px, 0.01 * std::hypot(640, 480), 1e-6);
  EXPECT_LT(diff.ranges[0].centre_px, 1e-6);
  EXPECT_EQ(diff.ranges[0].grid_px.cols(), options.grid_cols);
  EXPECT_NEAR(diff.ranges[0].grid_dx(0, 0), -0.01 * 640, 1e-6);
  EXPECT_EQ(diff.grid_axes_px(0, 0), 0);
  EXPECT_EQ(diff.grid_axes_px(0, options.grid_cols - 1), 1280);
}

/// At one range, a longer focal length and a step back are alike for a pinhole: x f (1 + e) / z = x f / (z + dz), dz = -e z.
/// The points lie on a sphere, so that a remainder is left.
TEST(Projection, ImpliedTranslationTakesOutScaleAtOneRange) {
  const Camera reference = geometry::MakePinhole("a", 1280, 960, 8000);
  Camera camera = reference;
  camera.params.head<2>() *= 1.001;
  ProjectionDiffOptions options;
  options.ranges_m = {5};
  const ProjectionDiff diff = CompareProjection(camera, reference, options);
  EXPECT_LT(diff.ranges[0].rms_px, 2e-3);
  EXPECT_NEAR(diff.translation_m, 5e-3, 1e-4);
  EXPECT_GT(diff.cam_from_reference.translation.z(), 0);
}

/// Between lenses of different kinds, the numbers of an independent fit: none; but the difference must be symmetric to first
/// order.
TEST(Projection, IsSymmetricToFirstOrder) {
  const Camera a = Lens();
  Camera b = a;
  b.params[4] += 0.002, b.params[0] += 0.7;
  const ProjectionDiff ab = CompareProjection(a, b), ba = CompareProjection(b, a);
  for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(ab.ranges[i].rms_px, ba.ranges[i].rms_px, 0.02 * ab.ranges[i].rms_px);
}

TEST(Projection, FocusFitsTheMiddle) {
  const Camera a = Lens();
  Camera b = a;
  b.params[4] += 0.004;
  ProjectionDiffOptions narrow;
  narrow.focus = 0.3;
  EXPECT_LT(CompareProjection(b, a, narrow).ranges[1].centre_px, 0.02);
  EXPECT_GT(CompareProjection(b, a, narrow).ranges[1].max_px, CompareProjection(b, a).ranges[1].max_px);
}

TEST(Projection, RefusesDifferentImages) {
  const Camera a = geometry::MakePinhole("a", 640, 480, 500), b = geometry::MakePinhole("b", 641, 480, 500);
  EXPECT_EQ(CompareProjection(a, b).status, Status::kDegenerate);
  ProjectionDiffOptions options;
  options.ranges_m = {-1};
  EXPECT_THROW(CompareProjection(a, a, options), ContractViolation);
}

}  // namespace
}  // namespace mvstudio::calib
