#include "triangulate/batch/batch.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <map>

#include "core/error.h"
#include "tests/triangulate/support.h"

namespace mvstudio::triangulate {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

void Put(const std::vector<Observation>& observations, int64_t point, PointBatch* batch) {
  for (const Observation& seen : observations) {
    const size_t at = static_cast<size_t>(seen.camera_idx * batch->num_points + point);
    batch->x_px[at] = seen.px.x(), batch->y_px[at] = seen.px.y(), batch->sigma_px[at] = seen.sigma_px;
  }
}

std::vector<Observation> Take(const PointBatch& batch, int64_t point) {
  std::vector<Observation> observations;
  for (int c = 0; c < batch.num_cameras; ++c) {
    const size_t at = static_cast<size_t>(c * batch.num_points + point);
    if (std::isnan(batch.x_px[at]) || std::isnan(batch.y_px[at])) continue;
    observations.push_back({c, {batch.x_px[at], batch.y_px[at]}, batch.sigma_px[at], 1});
  }
  return observations;
}

/// Points of every kind: clean, noisy, with outliers, seen by few, far, at infinity, behind, at a centre, with broken numbers.
PointBatch MixedBatch(const geometry::Rig& rig, int64_t num_points, uint64_t seed) {
  PointBatch batch = MakeBatch(static_cast<int>(rig.cameras.size()), num_points);
  Rng rng(seed);
  for (int64_t i = 0; i < num_points; ++i) {
    const int kind = static_cast<int>(i % 12);
    Eigen::Vector3d x = RandomPoint(&rng);
    if (kind == 7) x *= 1e6;
    if (kind == 8) x = rig.cameras[0].CenterInWorld();
    std::vector<Observation> seen = Observe(rig, x, kind == 0 ? 0 : 1.0, &rng);
    if (kind == 1) seen[rng.Index(static_cast<int64_t>(seen.size()))].px += Eigen::Vector2d(70, -50);
    if (kind == 2) seen.resize(static_cast<size_t>(rng.Index(4)));
    if (kind == 3) seen[0].px.x() = kInfinity;
    if (kind == 3 && i % 24 < 12) seen.resize(2);
    if (kind == 4) seen[1].sigma_px = i % 24 < 12 ? 0 : kNan;
    if (kind == 5) seen = {seen[0], {1, {1e5, -1e5}, 1, 1}};
    if (kind == 6 && i % 24 < 12) {  // all disagree
      for (Observation& each : seen) each.px = {rng.Uniform(0, 1279), rng.Uniform(0, 959)};
    }
    if (kind == 9) {  // mirrored through the principal point
      seen.resize(std::min<size_t>(seen.size(), 3));
      for (Observation& each : seen) each.px = 2 * Eigen::Vector2d(639.5, 479.5) - each.px + Eigen::Vector2d(200, 0);
    }
    if (kind == 10) seen.resize(2);
    Put(seen, i, &batch);
  }
  return batch;
}

std::map<Status, int> ExpectAsPoint(const PreparedRig& rig, const PointBatch& batch, const BatchOptions& options,
                                    double sigmas_apart) {
  const BatchResult result = TriangulateBatch(rig, batch, options);
  std::map<Status, int> statuses;
  for (int64_t i = 0; i < batch.num_points; ++i) {
    PointOptions own = options.point;
    own.seed += static_cast<uint64_t>(i);
    const std::vector<Observation> observations = Take(batch, i);
    const Point point = TriangulatePoint(rig, observations, own);
    EXPECT_EQ(result.StatusOf(i), point.status) << "point " << i;
    ++statuses[point.status];
    if (point.status != Status::kOk) {
      EXPECT_TRUE(std::isnan(result.x[i])) << "point " << i;
      continue;
    }
    const Eigen::Vector3d apart = Eigen::Vector3d(result.x[i], result.y[i], result.z[i]) - point.x_in_world;
    // Gauss-Newton stops at steps of 1e-6 sigma; its rate falls with the misfit, whose curvature it leaves out.
    const double slow = 1 + 1e-3 * std::sqrt(point.chi_squared);
    EXPECT_LT(std::sqrt(apart.dot(point.covariance.inverse() * apart)), slow * sigmas_apart) << "point " << i;
    const double relative = std::max(100 * sigmas_apart, 1e-8);
    for (int k = 0, row = 0; row < 3; ++row) {
      for (int col = row; col < 3; ++col, ++k) {
        EXPECT_NEAR(result.covariance[k * batch.num_points + i], point.covariance(row, col),
                    relative * std::sqrt(point.covariance(row, row) * point.covariance(col, col)));
      }
    }
    EXPECT_NEAR(result.chi_squared[i], point.chi_squared, relative * (1 + point.chi_squared));
    EXPECT_NEAR(result.rms_px[i], point.rms_px, relative * (1 + point.rms_px));
    EXPECT_EQ(result.num_views[i], static_cast<int>(point.used.size()));
    std::vector<int> used;
    for (size_t k = 0; k < observations.size(); ++k) {
      if (result.Used(observations[k].camera_idx, i)) used.push_back(static_cast<int>(k));
    }
    EXPECT_EQ(used, point.used) << "point " << i;
  }
  return statuses;
}

TEST(Batch, IsTriangulatePointForEveryStatus) {
  std::map<Status, int> seen;
  for (const int num_cameras : {2, 5, 8}) {
    const geometry::Rig rig = MakeRing(num_cameras == 2 ? 3 : num_cameras);
    BatchOptions options;
    options.point.max_distance_m = 1e5;
    for (const auto& [status, count] : ExpectAsPoint(Prepare(rig), MixedBatch(rig, 601, 5), options, 1e-5)) {
      seen[status] += count;
    }
  }
  for (const Status status : {Status::kOk, Status::kTooFewViews, Status::kNonFiniteInput, Status::kOutlier, Status::kDegenerate,
                              Status::kOutsideValidRadius}) {
    EXPECT_GT(seen[status], 0) << ToString(status);
  }
}

// Rays almost parallel, far points and points behind all cameras need cameras that look the same way.
TEST(Batch, IsTriangulatePointForCamerasSideBySide) {
  geometry::Rig parallel;
  for (const double y : {-2.0, 0.0, 2.0}) parallel.cameras.push_back(LookAt("c" + std::to_string(y), {0, y, 0}, {10, y, 0}));
  PointBatch batch = MakeBatch(3, 10);
  const double distance_m[] = {5, 20, 100, 150, 400, 1e3, 1e4, 1e7, 1e12};
  for (int i = 0; i < 9; ++i) Put(Observe(parallel, {distance_m[i], 0.1, 0.2}), i, &batch);
  for (int c = 0; c < 3; ++c) {  // the pixels of a point at (-3, 0, 0.5), projected through the centre
    const Eigen::Vector3d x = parallel.cameras[c].cam_from_world * Eigen::Vector3d(-3, 0, 0.5);
    Put({{c, {1000 * x.x() / x.z() + 639.5, 1000 * x.y() / x.z() + 479.5}, 1, 1}}, 9, &batch);
  }
  BatchOptions options;
  options.point.max_distance_m = 90;
  const auto statuses = ExpectAsPoint(Prepare(parallel), batch, options, 1e-5);
  EXPECT_GT(statuses.count(Status::kFarPoint), 0u);
  EXPECT_GT(statuses.count(Status::kLowParallax), 0u);
  EXPECT_GT(statuses.count(Status::kBehindCamera), 0u);
}

TEST(Batch, EveryMethodIsTriangulatePoint) {
  const geometry::Rig rig = MakeRing(5);
  const PointBatch batch = MixedBatch(rig, 120, 7);
  for (const PointMethod method : kAllPointMethods) {
    for (const bool select : {false, true}) {
      BatchOptions options;
      options.point.method = method;
      options.point.select_views = select;
      ExpectAsPoint(Prepare(rig), batch, options, 1e-5);
    }
  }
}

TEST(Batch, EveryLens) {
  for (const geometry::LensModel model : geometry::ModelsSimplestFirst()) {
    SCOPED_TRACE(geometry::ToString(model));
    geometry::Rig rig = MakeRing(4);
    for (geometry::RigCamera& camera : rig.cameras) {
      geometry::Camera& lens = camera.camera;
      const Eigen::Vector4d axis = lens.params.head<4>();
      lens.model = model;
      lens.params.setZero(geometry::NumParams(model));
      lens.params.head<4>() = axis;
      const std::vector<std::string> names = geometry::ParamNames(model);
      for (size_t k = 4; k < names.size(); ++k) {
        const bool small = names[k][0] == 'p' || names[k][0] == 's';
        lens.params[static_cast<int>(k)] = small ? 1e-3 : names[k] == "beta" ? 1.1 : names[k] == "k1" ? -0.2 : 0.05;
      }
    }
    BatchOptions options;
    options.point.method = PointMethod::kAllViews;
    const auto statuses = ExpectAsPoint(Prepare(rig), MixedBatch(rig, 48, 9), options, 1e-5);
    EXPECT_GT(statuses.count(Status::kOk), 0u) << geometry::ToString(model);
  }
}

bool SameBytes(const std::vector<double>& a, const std::vector<double>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
}

TEST(Batch, DoesNotDependOnThreadsOrPieces) {
  const geometry::Rig rig = MakeRing(6);
  const PreparedRig prepared = Prepare(rig);
  const PointBatch batch = MixedBatch(rig, 3001, 11);
  for (const bool single : {false, true}) {
    BatchOptions options;
    options.single_precision = single;
    RunContext run;
    run.num_threads = 1;
    const BatchResult one = TriangulateBatch(prepared, batch, options, run);
    for (const int threads : {2, 3, 7}) {
      run.num_threads = threads;
      const BatchResult many = TriangulateBatch(prepared, batch, options, run);
      EXPECT_TRUE(SameBytes(one.x, many.x) && SameBytes(one.y, many.y) && SameBytes(one.z, many.z));
      EXPECT_TRUE(SameBytes(one.covariance, many.covariance) && SameBytes(one.rms_px, many.rms_px));
      EXPECT_EQ(one.status, many.status);
      EXPECT_EQ(one.used, many.used);
    }
    const int64_t first = 1001, count = 500;  // a piece that begins in the middle of everything
    PointBatch piece = MakeBatch(batch.num_cameras, count);
    for (int64_t i = 0; i < count; ++i) Put(Take(batch, first + i), i, &piece);
    options.first_point = first;
    const BatchResult part = TriangulateBatch(prepared, piece, options, run);
    EXPECT_EQ(std::memcmp(part.x.data(), one.x.data() + first, count * sizeof(double)), 0);
    EXPECT_EQ(std::memcmp(part.chi_squared.data(), one.chi_squared.data() + first, count * sizeof(double)), 0);
  }
}

TEST(Batch, FewStepsAndSinglePrecisionStayNearTheOptimum) {
  const geometry::Rig rig = MakeRing(5);
  const PreparedRig prepared = Prepare(rig);
  Rng rng(13);
  PointBatch batch = MakeBatch(5, 2000);
  for (int64_t i = 0; i < batch.num_points; ++i) Put(Observe(rig, RandomPoint(&rng), 1.0, &rng), i, &batch);
  BatchOptions options;
  options.point.method = PointMethod::kAllViews;
  options.gauss_newton_steps = 2;
  ExpectAsPoint(prepared, batch, options, 1e-3);
  options.gauss_newton_steps = 0;
  options.single_precision = true;
  ExpectAsPoint(prepared, batch, options, 0.02);
}

TEST(Batch, AFarWorldOriginCostsNothing) {
  const Eigen::Vector3d middle(6e4, -6.4e4, 4.8e4);
  const geometry::Rig rig = MakeRing(8, 3, middle);
  Rng rng(15);
  PointBatch batch = MakeBatch(8, 400);
  std::vector<Eigen::Vector3d> truth;
  for (int64_t i = 0; i < batch.num_points; ++i) {
    truth.push_back(middle + RandomPoint(&rng));
    Put(Observe(rig, truth.back()), i, &batch);
  }
  const BatchResult result = TriangulateBatch(Prepare(rig), batch);
  for (int64_t i = 0; i < batch.num_points; ++i) {
    ASSERT_EQ(result.StatusOf(i), Status::kOk);
    EXPECT_LT((Eigen::Vector3d(result.x[i], result.y[i], result.z[i]) - truth[i]).norm(), 5e-10);
  }
}

TEST(Batch, OneImageUnderTwoNamesCountsOnce) {
  geometry::Rig rig = MakeRing(4);
  rig.cameras.push_back(rig.cameras[1]);
  rig.cameras.back().camera.name = "again";
  Rng rng(17);
  PointBatch batch = MakeBatch(5, 20);
  for (int64_t i = 0; i < 20; ++i) {
    std::vector<Observation> seen = Observe(rig, RandomPoint(&rng), 1.0, &rng);
    seen[4].px = seen[1].px;
    Put(seen, i, &batch);
  }
  ExpectAsPoint(Prepare(rig), batch, {}, 1e-5);
  EXPECT_EQ(TriangulateBatch(Prepare(rig), batch).num_views[3], 4);
}

TEST(Batch, SizesAreChecked) {
  const PreparedRig rig = Prepare(MakeRing(3));
  EXPECT_EQ(TriangulateBatch(rig, MakeBatch(3, 0)).num_points, 0);
  EXPECT_THROW(TriangulateBatch(rig, MakeBatch(2, 5)), ContractViolation);
  PointBatch batch = MakeBatch(3, 5);
  batch.sigma_px.pop_back();
  EXPECT_THROW(TriangulateBatch(rig, batch), ContractViolation);
  BatchOptions options;
  options.gauss_newton_steps = 9;
  EXPECT_THROW(TriangulateBatch(rig, MakeBatch(3, 5), options), ContractViolation);
}

TEST(Batch, CanBeCancelled) {
  struct Stop : ProgressSink {
    bool Cancelled() const override { return true; }
  } stop;
  RunContext run;
  run.progress = &stop;
  EXPECT_THROW(TriangulateBatch(Prepare(MakeRing(3)), MakeBatch(3, 50), {}, run), CancelledError);
}

}  // namespace
}  // namespace mvstudio::triangulate
