#include "avatar/body/measure/surface_error.h"

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "core/random.h"
#include "core/units.h"
#include "geometry/rigid/rigid3.h"
#include "tests/support/test.h"

namespace mvstudio::body {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Rings and segments; every vertex lies on the sphere.
Surface Sphere(double radius, const Eigen::Vector3d& center = Eigen::Vector3d::Zero(), int rings = 60) {
  const int columns = 2 * rings;
  Surface s;
  s.vertices.resize(3, columns * (rings - 1) + 2);
  for (int r = 1; r < rings; ++r) {
    for (int c = 0; c < columns; ++c) {
      const double theta = kPi * r / rings, phi = 2 * kPi * c / columns;
      s.vertices.col((r - 1) * columns + c) =
          center + radius * Eigen::Vector3d(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta));
    }
  }
  const int top = columns * (rings - 1), bottom = top + 1;
  s.vertices.col(top) = center + Eigen::Vector3d(0, 0, radius), s.vertices.col(bottom) = center - Eigen::Vector3d(0, 0, radius);
  std::vector<Eigen::Vector3i> faces;
  for (int c = 0; c < columns; ++c) {
    const int d = (c + 1) % columns, last = columns * (rings - 2);
    faces.emplace_back(top, c, d);
    faces.emplace_back(bottom, last + d, last + c);
    for (int r = 0; r + 2 < rings; ++r) {
      faces.emplace_back(r * columns + c, (r + 1) * columns + c, (r + 1) * columns + d);
      faces.emplace_back(r * columns + c, (r + 1) * columns + d, r * columns + d);
    }
  }
  s.faces.resize(3, static_cast<Eigen::Index>(faces.size()));
  for (size_t f = 0; f < faces.size(); ++f) s.faces.col(static_cast<Eigen::Index>(f)) = faces[f];
  return s;
}

/// A square of side 2 in the plane z = x tan(tilt).
Surface Square(double tilt, bool flipped = false) {
  Surface s;
  s.vertices.resize(3, 4);
  s.vertices << -1, 1, 1, -1, -1, -1, 1, 1, -std::tan(tilt), std::tan(tilt), std::tan(tilt), -std::tan(tilt);
  s.faces.resize(3, 2);
  if (flipped) {
    s.faces << 0, 0, 2, 3, 1, 2;
  } else {
    s.faces << 0, 0, 1, 2, 2, 3;
  }
  return s;
}

Surface Triangles(Rng* rng, int count) {
  Surface s;
  s.vertices.resize(3, 3 * count), s.faces.resize(3, count);
  for (int f = 0; f < count; ++f) {
    const Eigen::Vector3d at(rng->Normal(), rng->Normal(), rng->Normal());
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d off(rng->Normal(), rng->Normal(), rng->Normal());
      s.vertices.col(3 * f + k) = at + (f % 7 == 3 ? 0.0 : 0.3) * off;  // some are points
      if (f % 7 == 5 && k == 2) s.vertices.col(3 * f + 2) = 0.5 * (s.vertices.col(3 * f) + s.vertices.col(3 * f + 1));
      s.faces(k, f) = 3 * f + k;
    }
  }
  return s;
}

TEST(SurfaceTree, FindsTheNearestPointOfAllTriangles) {
  Rng rng(5);
  const Surface s = Triangles(&rng, 300);
  const SurfaceTree tree(s);
  for (int i = 0; i < 300; ++i) {
    const double far = i % 10 == 0 ? 1e4 : 2;
    const Eigen::Vector3d x(far * rng.Normal(), far * rng.Normal(), far * rng.Normal());
    const SurfaceTree::Nearest nearest = tree.Find(x);
    double least = 1e300;
    for (Eigen::Index f = 0; f < s.faces.cols(); ++f) {
      const Surface one{s.vertices, s.faces.col(f)};
      least = std::min(least, SurfaceTree(one).Find(x).distance_m);
    }
    EXPECT_EQ(nearest.distance_m, least);
    // The nearest point p of a triangle: no corner lies beyond the plane through p across x - p.
    Eigen::Vector3d p = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k) p += nearest.weights[k] * s.vertices.col(s.faces(k, nearest.face));
    EXPECT_NEAR((x - p).norm(), nearest.distance_m, 1e-12 * far);
    for (int k = 0; k < 3; ++k) EXPECT_LT((x - p).normalized().dot(s.vertices.col(s.faces(k, nearest.face)) - p), 1e-9);
    EXPECT_NEAR(nearest.weights.sum(), 1, 1e-12);
    EXPECT_GE(nearest.weights.minCoeff(), 0);
  }
}

TEST(SurfaceTree, RaysMeetASphereFromInsideAndFromOutside) {
  const SurfaceTree tree(Sphere(1, {0, 0, 0}, 12));
  Rng rng(1);
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d direction = Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal()).normalized();
    EXPECT_TRUE(tree.Meets({0.1, -0.2, 0.3}, direction, 0));
    EXPECT_TRUE(tree.Meets(-3 * direction, direction, 0));
    EXPECT_FALSE(tree.Meets(3 * direction, direction, 0));
    EXPECT_FALSE(tree.Meets(-3 * direction, direction, 5));
    EXPECT_FALSE(tree.Meets(-3 * direction, direction.unitOrthogonal(), 0));
  }
  EXPECT_TRUE(tree.Meets({0, 0, -3}, {0, 0, 1}, 0));
}

TEST(CompareVertices, OfAMovedSphereIsTheWay) {
  const Surface sphere = Sphere(1);
  const Surface moved = Sphere(1, {0.3, -0.4, 1.2});
  const VertexError error = CompareVertices(moved.vertices, sphere.vertices);
  ASSERT_EQ(error.status, Status::kOk);
  EXPECT_NEAR(error.mean_m, 1.3, 1e-12);
  EXPECT_LT(error.procrustes_m, 1e-12);
}

TEST(CompareVertices, ASimilarityIsNothingToProcrustes) {
  Rng rng(2);
  const Surface shape = Triangles(&rng, 50);
  const Eigen::Matrix3d rotation = 1.7 * geometry::RotationExp({0.5, -2, 1}).toRotationMatrix();
  const Eigen::Matrix3Xd other = (rotation * shape.vertices).colwise() + Eigen::Vector3d(100, -20, 3);
  const VertexError error = CompareVertices(other, shape.vertices);
  ASSERT_EQ(error.status, Status::kOk);
  EXPECT_LT(error.procrustes_m, 1e-10);
  EXPECT_GT(error.mean_m, 90);
  Eigen::Matrix3Xd mirrored = shape.vertices;
  mirrored.row(0) *= -1;
  EXPECT_GT(CompareVertices(mirrored, shape.vertices).procrustes_m, 0.1);
}

TEST(CompareVertices, WhatHasNoAlignmentIsAStatus) {
  const Eigen::Matrix3Xd cube = Eigen::Matrix3Xd::Random(3, 8);
  Eigen::Matrix3Xd broken = cube;
  broken(1, 4) = kNaN;
  EXPECT_EQ(CompareVertices(broken, cube).status, Status::kNonFiniteInput);
  EXPECT_EQ(CompareVertices(cube, broken).status, Status::kNonFiniteInput);
  EXPECT_TRUE(std::isnan(CompareVertices(cube, broken).mean_m));
  EXPECT_EQ(CompareVertices(cube.leftCols(2), cube.leftCols(2)).status, Status::kTooFewViews);
  Eigen::Matrix3Xd line = Eigen::Matrix3Xd::Zero(3, 8);
  line.row(0).setLinSpaced(0, 1);
  EXPECT_EQ(CompareVertices(line, line).status, Status::kDegenerate);
}

TEST(CompareSurfaces, OfSpheresAboutOnePointIsTheDifferenceOfRadii) {
  const SurfaceError error = CompareSurfaces(Sphere(1.1), Sphere(1), 1);
  ASSERT_EQ(error.status, Status::kOk);
  const double sag = 1 - std::cos(kPi / 60);  // of the faces
  EXPECT_NEAR(error.to_truth.mean_m, 0.1, 2 * sag);
  EXPECT_NEAR(error.from_truth.mean_m, 0.1, 2 * sag);
  EXPECT_NEAR(error.chamfer_m(), 0.1, 2 * sag);
  EXPECT_NEAR(error.to_truth.p95_m, 0.1, 2 * sag);
  EXPECT_NEAR(error.vertex_rms_m, 0.1, 2 * sag);
  EXPECT_LT(error.normal_rad(), DegToRad(0.2));
}

TEST(CompareSurfaces, OfAMovedSphereIsHalfTheWayForSmallWays) {
  const double way = 0.05;  // mean of |cos| over the sphere is 1/2
  const SurfaceError error = CompareSurfaces(Sphere(1, {0, way, 0}), Sphere(1), 2);
  ASSERT_EQ(error.status, Status::kOk);
  EXPECT_NEAR(error.chamfer_m(), way / 2, 0.001);
  EXPECT_NEAR(error.normal_rad(), way * kPi / 4, 0.002);  // mean of sin over the sphere
}

TEST(CompareSurfaces, ASurfaceLiesOnItself) {
  Rng rng(8);
  const Surface s = Sphere(0.4, {5, 3, -2});
  const SurfaceError error = CompareSurfaces(s, s, 2);
  EXPECT_LT(error.chamfer_m(), 1e-12);
  EXPECT_LT(error.normal_rad(), 1e-6);
  EXPECT_LT(error.vertex_rms_m, 1e-12);
}

TEST(CompareSurfaces, NormalsOfTiltedPlanesDifferByTheTilt) {
  for (const double tilt : {0.0, 0.2, 0.7}) {
    EXPECT_NEAR(CompareSurfaces(Square(tilt), Square(0), 1).normal_rad(), tilt, 1e-9);
    EXPECT_NEAR(CompareSurfaces(Square(tilt, true), Square(0), 1).normal_rad(), kPi - tilt, 1e-9);
  }
}

TEST(CompareSurfaces, IsTheSameForAnyThreadsAndAnyRigidMotionOfBoth) {
  const Surface a = Sphere(1, {0.1, 0.2, 0}), b = Sphere(0.9);
  const SurfaceError one = CompareSurfaces(a, b, 1), two = CompareSurfaces(a, b, 2);
  EXPECT_EQ(one.chamfer_m(), two.chamfer_m());
  EXPECT_EQ(one.normal_rad(), two.normal_rad());
  Surface c = a, d = b;
  const geometry::Rigid3 away{geometry::RotationExp({1, 0.4, -0.3}), {30, -20, 10}};
  for (Surface* s : {&c, &d}) {
    for (Eigen::Index v = 0; v < s->vertices.cols(); ++v) s->vertices.col(v) = away * Eigen::Vector3d(s->vertices.col(v));
  }
  EXPECT_NEAR(CompareSurfaces(c, d, 1).chamfer_m(), one.chamfer_m(), 1e-12);
  EXPECT_NEAR(CompareSurfaces(c, d, 1).normal_rad(), one.normal_rad(), 1e-9);
}

TEST(CompareSurfaces, WhatIsNoSurfaceIsAStatus) {
  const Surface good = Square(0);
  Surface broken = good, empty = good, flat = good;
  broken.vertices(0, 1) = kNaN;
  empty.faces.resize(3, 0);
  flat.vertices.row(0).setZero(), flat.vertices.row(2).setZero();
  EXPECT_EQ(CompareSurfaces(broken, good, 1).status, Status::kNonFiniteInput);
  EXPECT_EQ(CompareSurfaces(good, broken, 1).status, Status::kNonFiniteInput);
  for (const Surface& bad : {empty, flat}) {
    EXPECT_EQ(CompareSurfaces(bad, good, 1).status, Status::kDegenerate);
    EXPECT_EQ(CompareSurfaces(good, bad, 1).status, Status::kDegenerate);
  }
}

TEST(SeenFromOutside, LeavesOutWhatLiesInside) {
  const Surface outer = Sphere(1, {0, 0, 0}, 16), inner = Sphere(0.6, {0.1, 0, 0}, 16);
  Surface both = outer;
  both.vertices.conservativeResize(Eigen::NoChange, outer.vertices.cols() + inner.vertices.cols());
  both.vertices.rightCols(inner.vertices.cols()) = inner.vertices;
  both.faces.conservativeResize(Eigen::NoChange, outer.faces.cols() + inner.faces.cols());
  both.faces.rightCols(inner.faces.cols()) = inner.faces.array() + static_cast<int>(outer.vertices.cols());
  EXPECT_EQ(SeenFromOutside(both, 2).faces, outer.faces);
  EXPECT_EQ(SeenFromOutside(outer, 1).faces, outer.faces);
  EXPECT_EQ(SeenFromOutside(Square(0.3), 1).faces.cols(), 2);
}

}  // namespace
}  // namespace mvstudio::body
