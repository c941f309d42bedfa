#include "avatar/body/soft/soft_silhouette.h"

#include <cmath>
#include <limits>

#include "avatar/body/fit/rim.h"
#include "avatar/body/soft/mesh_outline.h"
#include "core/random.h"
#include "tests/body/fit_studio.h"
#include "tests/support/test.h"

namespace mvstudio::body {
namespace {

using Eigen::Vector2d;

Eigen::Matrix3Xi Faces(const std::vector<Eigen::Vector3i>& list) {
  Eigen::Matrix3Xi faces(3, static_cast<Eigen::Index>(list.size()));
  for (size_t f = 0; f < list.size(); ++f) faces.col(static_cast<Eigen::Index>(f)) = list[f];
  return faces;
}

ScreenVertices Screen(const std::vector<Vector2d>& px) {
  ScreenVertices screen{Eigen::Matrix2Xd(2, px.size()), std::vector<uint8_t>(px.size(), 1)};
  for (size_t v = 0; v < px.size(); ++v) screen.px.col(static_cast<Eigen::Index>(v)) = px[v];
  return screen;
}

const Eigen::Matrix3Xi kSquare = Faces({{0, 1, 2}, {0, 2, 3}});

ScreenVertices SquareAt(double low, double high) { return Screen({{low, low}, {high, low}, {high, high}, {low, high}}); }

/// Distance of a point from the border of an upright square, positive inside.
double SquareDepth(const Vector2d& at, double low, double high) {
  const Vector2d from_low = at.array() - low, to_high = high - at.array();
  const double inside = std::min(from_low.minCoeff(), to_high.minCoeff());
  if (inside >= 0) return inside;
  return -Vector2d((-from_low).cwiseMax(-to_high).cwiseMax(0)).norm();
}

/// Weighted sum of all pixels' cover.
double Weighted(const SoftCover& soft, const std::vector<double>& weights) {
  double sum = 0;
  for (size_t i = 0; i < weights.size(); ++i) sum += weights[i] * soft.cover[i];
  return sum;
}

std::vector<double> RandomWeights(size_t count, uint64_t seed) {
  Rng rng(seed);
  std::vector<double> weights(count);
  for (double& weight : weights) weight = rng.Normal();
  return weights;
}

struct Derivatives {
  double gradient = 0, difference = 0;
};

/// Of a random function of the cover along a random motion of the vertices: ours, and the central difference.
Derivatives Compare(const Eigen::Matrix3Xi& faces, const ScreenVertices& screen, int size, uint64_t seed) {
  const SoftCoverOptions options{4e-3};
  const std::vector<double> weights = RandomWeights(static_cast<size_t>(size) * size, seed);
  Rng rng(seed + 1);
  Eigen::Matrix2Xd motion(2, screen.px.cols());
  for (double& value : motion.reshaped()) value = rng.Normal();
  const SoftCover soft = RenderSoftCover(faces, screen, size, size, options);
  constexpr double kStep = 1e-6;
  ScreenVertices more = screen, less = screen;
  more.px += kStep * motion, less.px -= kStep * motion;
  const double high = Weighted(RenderSoftCover(faces, more, size, size, options), weights);
  const double low = Weighted(RenderSoftCover(faces, less, size, size, options), weights);
  return {SoftCoverGradient(soft, weights, screen.px.cols()).cwiseProduct(motion).sum(), (high - low) / (2 * kStep)};
}

TEST(SoftSilhouette, CoverOfASquareIsThatOfItsDistance) {
  const SoftCoverOptions options{4e-3, 1e-4};
  const SoftCover soft = RenderSoftCover(kSquare, SquareAt(9.3, 22.6), 32, 32, options);
  EXPECT_NEAR(soft.sigma_px2, 4e-3 * 256, 1e-12);
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 32; ++x) {
      const double depth = SquareDepth({x, y}, 9.3, 22.6);
      const double expected = 1 / (1 + std::exp(-depth * std::abs(depth) / soft.sigma_px2));
      EXPECT_NEAR(soft.cover[y * 32 + x], expected, 1.01e-4) << x << " " << y;
    }
  }
}

TEST(SoftSilhouette, EdgesInsideTheUnionAreNoOutline) {
  // Two squares over each other, without a common vertex: the outline is that of an octagon with corners turned in.
  ScreenVertices screen = Screen({{5, 10}, {25, 10}, {25, 20}, {5, 20}, {10, 5}, {20, 5}, {20, 25}, {10, 25}});
  const Eigen::Matrix3Xi faces = Faces({{0, 1, 2}, {0, 2, 3}, {4, 6, 5}, {4, 7, 6}});
  const MeshOutline outline = FindOutline(faces, screen, 32, 32, 4);
  double length = 0;
  for (const OutlinePiece& piece : outline.pieces)
    length += (piece.last - piece.first) * (screen.px.col(piece.b) - screen.px.col(piece.a)).norm();
  EXPECT_NEAR(length, 4 * 10 + 8 * 5, 1e-9);
  EXPECT_EQ(outline.skipped_faces, 0);
}

TEST(SoftSilhouette, GradientIsTheCentralDifference) {
  const Derivatives square = Compare(kSquare, Screen({{9.3, 8.1}, {23.2, 9.9}, {22.7, 24.6}, {8.2, 20.5}}), 32, 3);
  EXPECT_NEAR(square.gradient, square.difference, 1e-6 * std::abs(square.difference) + 1e-7);
  for (uint64_t seed = 0; seed < 20; ++seed) {
    Rng rng(100 + seed);
    std::vector<Vector2d> px;
    std::vector<Eigen::Vector3i> faces;
    for (int v = 0; v < 12; ++v) px.push_back({32 * rng.Uniform(), 32 * rng.Uniform()});
    for (int f = 0; f < 5; ++f) faces.push_back({(f * 5) % 12, (f * 5 + 3) % 12, (f * 5 + 7) % 12});
    const Derivatives mesh = Compare(Faces(faces), Screen(px), 32, seed);
    EXPECT_NEAR(mesh.gradient, mesh.difference, 1e-4 * std::abs(mesh.difference) + 1e-6) << seed;
  }
}

TEST(SoftSilhouette, GradientOfABodyIsTheCentralDifference) {
  const BodyTemplate body = MakeMannequin(1.75, 0.5);
  const ScreenVertices screen = ProjectVertices(body.vertices, testing::CameraAt(0.4, 1.2, 96));
  int good = 0;
  constexpr int kTrials = 10;
  for (uint64_t seed = 0; seed < kTrials; ++seed) {
    const Derivatives derivatives = Compare(body.faces, screen, 96, seed);
    good += std::abs(derivatives.gradient - derivatives.difference) < 1e-3 * std::abs(derivatives.difference) + 1e-4;
  }
  EXPECT_GE(good, kTrials - 1);  // where a step passes a fold of the outline, differences say nothing
}

TEST(SoftSilhouette, GradientReachesOutsideTheMesh) {
  Image mask(32, 32, 1);
  for (int y = 6; y < 27; ++y) {
    for (int x = 6; x < 27; ++x) *mask.Pixel(x, y) = 255;
  }
  // All that is wrong lies outside the square: its corners have to move outwards.
  const SoftCover soft = RenderSoftCover(kSquare, SquareAt(8.5, 24.5), 32, 32, {4e-3});
  std::vector<double> d_cover(soft.cover.size(), 0);
  for (size_t i = 0; i < d_cover.size(); ++i) {
    if (soft.cover[i] < 0.5) d_cover[i] = 2 * (soft.cover[i] - mask.pixels[i] / 255.0);
  }
  const Eigen::Matrix2Xd gradient = SoftCoverGradient(soft, d_cover, 4);
  EXPECT_GT(gradient.col(0).minCoeff(), 0.1);
  EXPECT_LT(gradient.col(2).maxCoeff(), -0.1);
}

TEST(SoftSilhouette, StepsDownTheGradientBringABodyToItsMask) {
  const BodyTemplate body = MakeMannequin(1.75, 0.5);
  const geometry::RigCamera camera = testing::CameraAt(0.4, 1.2, 96);
  const Eigen::Vector3f away(0.03f, 0, 0.05f);
  const Image mask = RasterizeCover(body.faces, body.vertices.colwise() + away, camera);
  Eigen::Vector3f shift = Eigen::Vector3f::Zero();  // the body moves as a whole
  double before = std::numeric_limits<double>::infinity();
  for (int step = 0; step < 16; ++step) {
    const SilhouetteTerm term = SilhouetteLoss(body.faces, body.vertices.colwise() + shift, camera, mask, {});
    EXPECT_LT(term.loss, before) << step;
    before = term.loss;
    shift -= (0.003 * term.gradient.rowwise().sum().normalized()).cast<float>();
  }
  const Eigen::Vector3d left = camera.cam_from_world.rotation * (away - shift).cast<double>();
  EXPECT_LT(left.head<2>().norm(), 0.4 * away.norm());  // across the line of sight
}

TEST(SoftSilhouette, WhatHasNoImageIsSkippedAndCounted) {
  const geometry::RigCamera camera = testing::CameraAt(0, 1, 64);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  Eigen::Matrix3Xf vertices(3, 15);
  vertices << 0, 0.3f, 0, /**/ 0, 0.3f, 0, /**/ 0, nan, 0, /**/ 0, 0.1f, 0.2f, /**/ 0, 0.1f, 0,  //
      0, 0, 0, /**/ -9, -9, -9, /**/ 0, 0, 0, /**/ 0, 0, 0, /**/ 0, 0, -3,                       //
      0.9f, 0.9f, 1.2f, /**/ 1, 1, 1.2f, /**/ 1, 1, 1, /**/ 1, 1, 1, /**/ 1, 1, 1;
  // Whole, behind the camera, not a number, on a line, in the camera's plane.
  const Eigen::Matrix3Xi faces = Faces({{0, 1, 2}, {3, 4, 5}, {6, 7, 8}, {9, 9, 11}, {12, 13, 14}});
  Image mask(64, 64, 1);
  const SilhouetteTerm all = SilhouetteLoss(faces, vertices, camera, mask, {});
  const SilhouetteTerm alone = SilhouetteLoss(faces.leftCols<1>(), vertices, camera, mask, {});
  EXPECT_EQ(all.skipped_faces, 4);
  EXPECT_EQ(alone.skipped_faces, 0);
  EXPECT_EQ(all.loss, alone.loss);
  EXPECT_GT(all.loss, 0);
  EXPECT_TRUE(all.gradient.allFinite());
  EXPECT_EQ(all.gradient, alone.gradient);
}

TEST(SoftSilhouette, HugeAndTinyFacesAreFinite) {
  Image mask(64, 64, 1, 255);
  for (const double size : {1e-9, 1e-3, 1e5, 1e8}) {
    const ScreenVertices screen = Screen({{20, 20}, {20 + size, 21}, {19, 20 + size}});
    const SoftCover soft = RenderSoftCover(Faces({{0, 1, 2}}), screen, 64, 64, {});
    const std::vector<double> weights(soft.cover.size(), 1);
    EXPECT_EQ(soft.skipped_faces, 0) << size;
    EXPECT_TRUE(SoftCoverGradient(soft, weights, 3).allFinite()) << size;
    for (const double value : soft.cover) EXPECT_TRUE(value >= 0 && value <= 1);
    EXPECT_FALSE(soft.band.empty()) << size;
  }
  const ScreenVertices beyond = Screen({{20, 20}, {1e12, 21}, {19, std::numeric_limits<double>::infinity()}});
  EXPECT_EQ(RenderSoftCover(Faces({{0, 1, 2}}), beyond, 64, 64, {}).skipped_faces, 1);
}

TEST(SoftSilhouette, IsTheHardCoverAwayFromTheOutline) {
  const BodyTemplate body = MakeMannequin(1.75, 0.5);
  const geometry::RigCamera camera = testing::CameraAt(1.1, 1.2, 128);
  const ScreenVertices screen = ProjectVertices(body.vertices, camera);
  const SoftCover soft = RenderSoftCover(body.faces, screen, 128, 128, {});
  const Image hard = RasterizeCover(body.faces, body.vertices, camera);
  for (size_t i = 0; i < hard.pixels.size(); ++i) EXPECT_EQ(soft.cover[i] > 0.5, hard.pixels[i] > 0) << i;
  EXPECT_GT(soft.band.size(), 500u);
}

}  // namespace
}  // namespace mvstudio::body
