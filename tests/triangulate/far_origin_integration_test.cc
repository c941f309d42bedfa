#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <map>

#include "core/statistics.h"
#include "dataset/panoptic/panoptic.h"
#include "tests/support/test_data.h"
#include "tests/triangulate/oracle.h"
#include "tests/triangulate/support.h"
#include "triangulate/batch/batch.h"
#include "triangulate/point/solvers.h"

/// The CMU Panoptic calibration with its world moved away. Pixels are projected in 60 digits through the very numbers that the
/// moved rig has, so that every error is the solver's own.
namespace mvstudio::triangulate {
namespace {

constexpr int kPoints = 101;

geometry::Rig EightHdCameras() {
  const geometry::Rig all =
      dataset::ReadPanopticCalibration(testing::DataRoot() + "/panoptic/160906_band1/calibration_160906_band1.json");
  geometry::Rig rig;
  for (const char* name : {"00_00", "00_04", "00_08", "00_12", "00_16", "00_20", "00_24", "00_28"}) {
    rig.cameras.push_back(all.cameras[all.Find(name)]);
  }
  return rig;
}

geometry::Rig Moved(geometry::Rig rig, const Eigen::Vector3d& offset) {
  for (geometry::RigCamera& camera : rig.cameras) {
    camera.cam_from_world.translation -= camera.cam_from_world.rotation * offset;
  }
  return rig;
}

/// Median absolute error of every method in cm, by name; the batch's as "batch", "batch, float".
std::map<std::string, double> Errors(const geometry::Rig& rig, const Eigen::Vector3d& middle) {
  const PreparedRig prepared = Prepare(rig);
  Rng rng(7);
  std::map<std::string, std::vector<double>> errors;
  PointBatch batch = MakeBatch(static_cast<int>(rig.cameras.size()), kPoints);
  std::vector<Eigen::Vector3d> truths;
  for (int i = 0; i < kPoints; ++i) {
    const Eigen::Vector3d truth = middle + RandomPoint(&rng, 0.8);
    truths.push_back(truth);
    std::vector<Observation> observations;
    for (size_t c = 0; c < rig.cameras.size(); ++c) {
      oracle::Vector2 px;
      EXPECT_TRUE(oracle::Project(rig.cameras[c], oracle::ToMp(truth), &px));
      observations.push_back({static_cast<int>(c), {static_cast<double>(px[0]), static_cast<double>(px[1])}, 1, 1});
      batch.x_px[c * kPoints + i] = observations.back().px.x();
      batch.y_px[c * kPoints + i] = observations.back().px.y();
    }
    for (const PointMethod method : kAllPointMethods) {
      PointOptions options;
      options.method = method;
      const Point point = TriangulatePoint(prepared, observations, options);
      EXPECT_EQ(point.status, Status::kOk) << ToString(method);
      errors[std::string(ToString(method))].push_back(100 * (point.x_in_world - truth).norm());
    }
  }
  for (const bool single : {false, true}) {
    BatchOptions options;
    options.single_precision = single;
    const BatchResult result = TriangulateBatch(prepared, batch, options);
    for (int i = 0; i < kPoints; ++i) {
      errors[single ? "batch, float" : "batch"].push_back(
          100 * (Eigen::Vector3d(result.x[i], result.y[i], result.z[i]) - truths[i]).norm());
    }
  }
  std::map<std::string, double> medians;
  for (const auto& [name, values] : errors) medians[name] = UpperMedian(values);
  return medians;
}

TEST(FarOrigin, ErrorsOfEverySolver) {
  MVS_NEEDS_DATA("panoptic");
  const geometry::Rig rig = EightHdCameras();
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const geometry::RigCamera& camera : rig.cameras) middle += camera.CenterInWorld() / 8;
  middle.z() = 1;
  // What inhomogeneous least squares in centred coordinates reached elsewhere on this calibration, cm.
  const std::pair<double, double> offset_and_reference_cm[] = {{0, 5.2e-14}, {10, 6.9e-13}, {1e3, 7.6e-11}, {1e5, 5.9e-9}};
  for (const auto& [offset_m, reference_cm] : offset_and_reference_cm) {
    const Eigen::Vector3d offset = offset_m * Eigen::Vector3d(0.6, -0.64, 0.48);
    const std::map<std::string, double> errors = Errors(Moved(rig, offset), middle + offset);
    std::printf("%8g m:", offset_m);
    for (const auto& [name, error] : errors) std::printf("  %s %.1e", name.c_str(), error);
    std::printf(" cm\n");
    for (const char* name : {"robust", "batch", "linear", "all-views", "lost"}) {
      EXPECT_LE(errors.at(name), 10 * errors.at("least-squares")) << name << " at " << offset_m << " m";
      EXPECT_LE(errors.at(name), 10 * reference_cm) << name << " at " << offset_m << " m";
    }
    EXPECT_LE(errors.at("dlt"), 1e3 * reference_cm) << offset_m;
    EXPECT_LE(errors.at("batch, float"), 1e-3) << offset_m;
  }
}

}  // namespace
}  // namespace mvstudio::triangulate
