#include <algorithm>
#include <cmath>

#include "calib/calibrate.h"
#include "geometry/rig/alignment.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

/// Footage that does not determine the calibration, or hardly: what is not known is named, never invented.
namespace mvstudio::calib {
namespace {

using geometry::LensModel;

CalibrateReport Solve(const CalibrateInput& input, LensModel model, const WorldOrigin& world = {}) {
  CalibrateOptions options;
  options.model = model;
  options.world = world;
  options.holdout_folds = 0;
  return Calibrate(input, options, RunContext());
}

/// Ends with a status, a message that contains one of `words`, and a failed verdict.
void ExpectNamed(const CalibrateReport& report, const std::vector<std::string>& words, const std::string& what) {
  EXPECT_NE(report.status, Status::kOk) << what;
  EXPECT_EQ(report.verdict.outcome(), Outcome::kFail) << what;
  const bool named = std::any_of(words.begin(), words.end(),
                                 [&](const std::string& word) { return report.message.find(word) != std::string::npos; });
  EXPECT_TRUE(named) << what << ": " << report.message;
}

TEST(ExtremeFootage, FrontoParallelBoardsNameTheFocalLength) {
  SceneOptions options;
  options.num_cameras = 1;
  options.max_tilt_rad = 0;
  for (LensModel model : {LensModel::kPinhole, LensModel::kBrown1, LensModel::kBrown4}) {
    for (double noise : {0.0, 0.1, 1.0}) {
      for (uint64_t seed : {1, 2, 3}) {
        options.model = model, options.noise_px = noise, options.seed = seed;
        const CalibrateReport report = Solve(testing::ToInput(MakeScene(options)), model);
        ExpectNamed(
            report, {"focal", "tilt", "fx", "parallel"},
            std::string(geometry::ToString(model)) + ", noise " + std::to_string(noise) + ", seed " + std::to_string(seed));
      }
    }
  }
}

TEST(ExtremeFootage, ASingleViewNeverPasses) {
  SceneOptions options;
  options.num_cameras = 1;
  options.num_frames = 1;
  for (LensModel model : {LensModel::kPinhole, LensModel::kBrown4, LensModel::kRational8, LensModel::kKannalaBrandt4}) {
    for (double noise : {0.0, 0.1}) {
      options.model = model, options.noise_px = noise;
      const CalibrateReport report = Solve(testing::ToInput(MakeScene(options)), model);
      const std::string what = std::string(geometry::ToString(model)) + ", noise " + std::to_string(noise);
      EXPECT_NE(report.verdict.outcome(), Outcome::kPass) << what;
      EXPECT_FALSE(report.verdict.reasons.empty()) << what;
      // A plane's homography gives two equations for the four numbers of a pinhole.
      if (model == LensModel::kPinhole) {
        EXPECT_NE(report.status, Status::kOk) << what;
      }
    }
  }
}

TEST(ExtremeFootage, CollinearCornersAreRefused) {
  SceneOptions options;
  options.num_cameras = 1;
  options.noise_px = 0.1;
  for (double noise : {0.0, 0.1}) {
    options.noise_px = noise;
    CalibrateInput input = testing::ToInput(MakeScene(options));
    for (Detection& d : input.detections) {  // the third row alone
      std::vector<int> keep;
      for (int i = 0; i < d.num_corners(); ++i) {
        if (d.corner_ids[i] / 9 == 2) keep.push_back(i);
      }
      Detection row = d;
      row.corner_ids.clear();
      row.points_px.resize(2, static_cast<Eigen::Index>(keep.size()));
      for (size_t i = 0; i < keep.size(); ++i)
        row.corner_ids.push_back(d.corner_ids[keep[i]]), row.points_px.col(i) = d.points_px.col(keep[i]);
      d = row;
    }
    const CalibrateReport report = Solve(input, LensModel::kPinhole);
    EXPECT_NE(report.status, Status::kOk) << "noise " << noise;
    EXPECT_FALSE(report.message.empty());
    EXPECT_EQ(report.verdict.outcome(), Outcome::kFail);
  }
}

TEST(ExtremeFootage, SomeCollinearViewsDoNoHarm) {
  SceneOptions options;
  options.num_cameras = 2;
  options.noise_px = 0.1;
  const Scene scene = MakeScene(options);
  CalibrateInput input = testing::ToInput(scene);
  for (size_t k = 0; k < input.detections.size(); k += 9) {
    Detection& d = input.detections[k];
    const int n = std::min(7, d.num_corners());
    d.corner_ids.resize(n);
    d.points_px = d.points_px.leftCols(n).eval();
  }
  const CalibrateReport report = Solve(input, LensModel::kBrown4);
  ASSERT_EQ(report.status, Status::kOk) << report.message;
  EXPECT_NEAR(report.rms_px, 0.1 * std::sqrt(2.0), 0.01);
  const geometry::RigDifference difference = geometry::CompareRigs(report.rig, testing::TruthRig(scene));
  EXPECT_LT(difference.max_translation_m, 2e-3);
  EXPECT_LT(difference.max_focal_relative, 2e-3);
}

TEST(ExtremeFootage, TwoCamerasInOnePlace) {
  for (double turn : {0.0, 0.3}) {
    for (double noise : {0.0, 0.1}) {
      SceneOptions options;
      options.noise_px = noise;
      Scene scene = MakeScene(options);
      geometry::Rigid3 rotated;
      rotated.rotation = geometry::RotationExp(Eigen::Vector3d(0, turn, 0.5 * turn));
      scene.truth.cam_from_world[1] = rotated * scene.truth.cam_from_world[0];
      testing::ObserveAll(&scene, noise, 31);
      const CalibrateReport report = Solve(testing::ToInput(scene), LensModel::kBrown4);
      ASSERT_EQ(report.status, Status::kOk) << "turn " << turn << ", noise " << noise << ": " << report.message;
      const geometry::Rigid3& found = report.rig.cameras[1].cam_from_world;
      if (noise == 0) {
        EXPECT_LT(found.translation.norm(), 1e-7);
        EXPECT_LT(geometry::RotationAngle(found.rotation, rotated.rotation), 1e-7);
        continue;
      }
      ASSERT_TRUE(report.rig.cameras[1].cam_from_world_covariance.has_value());
      Eigen::Matrix<double, 6, 1> error;
      error << geometry::RotationLog(found.rotation * rotated.rotation.conjugate()), found.translation;
      // chi-square with 6 degrees of freedom: beyond 33 once in 100 000
      EXPECT_LT(error.dot(report.rig.cameras[1].cam_from_world_covariance->ldlt().solve(error)), 33) << "turn " << turn;
    }
  }
}

/// Detections and cameras in another order; the names stay with the cameras.
CalibrateInput Permuted(const CalibrateInput& input, const std::vector<int>& new_from_old) {
  CalibrateInput result = input;
  for (size_t old = 0; old < new_from_old.size(); ++old) result.cameras[new_from_old[old]] = input.cameras[old];
  for (Detection& d : result.detections) d.camera_idx = new_from_old[d.camera_idx];
  std::reverse(result.detections.begin(), result.detections.end());
  return result;
}

TEST(ExtremeFootage, OrderOfCamerasAndDetectionsDoesNotChangeADigit) {
  SceneOptions options;
  options.num_cameras = 4;
  options.noise_px = 0.3;
  const CalibrateInput input = testing::ToInput(MakeScene(options));
  const CalibrateReport wanted = Solve(input, LensModel::kBrown4, {"cam1", {}});
  ASSERT_EQ(wanted.status, Status::kOk) << wanted.message;
  const std::vector<int> orders[] = {{3, 2, 1, 0}, {1, 0, 3, 2}, {0, 1, 2, 3}};
  for (const std::vector<int>& order : orders) {
    const CalibrateReport report = Solve(Permuted(input, order), LensModel::kBrown4, {"cam1", {}});
    ASSERT_EQ(report.status, Status::kOk) << report.message;
    EXPECT_EQ(report.rms_px, wanted.rms_px);
    for (int c = 0; c < 4; ++c) {
      const geometry::RigCamera &a = wanted.rig.cameras[c], &b = report.rig.cameras[order[c]];
      ASSERT_EQ(a.camera.name, b.camera.name);
      EXPECT_EQ((a.camera.params - b.camera.params).cwiseAbs().maxCoeff(), 0) << a.camera.name;
      EXPECT_EQ((a.cam_from_world.translation - b.cam_from_world.translation).norm(), 0) << a.camera.name;
      EXPECT_EQ((a.cam_from_world.rotation.coeffs() - b.cam_from_world.rotation.coeffs()).norm(), 0) << a.camera.name;
    }
  }
}

TEST(ExtremeFootage, NumberOfThreadsDoesNotChangeADigit) {
  SceneOptions options;
  options.num_cameras = 3;
  options.noise_px = 0.3;
  const CalibrateInput input = testing::ToInput(MakeScene(options));
  CalibrateOptions calibrate;
  calibrate.model = LensModel::kBrown4;
  calibrate.holdout_folds = 0;
  RunContext one, four;
  one.num_threads = 1, four.num_threads = 4;
  const CalibrateReport a = Calibrate(input, calibrate, one), b = Calibrate(input, calibrate, four);
  ASSERT_EQ(a.status, Status::kOk) << a.message;
  for (int c = 0; c < 3; ++c) {
    EXPECT_EQ((a.rig.cameras[c].camera.params - b.rig.cameras[c].camera.params).norm(), 0);
    EXPECT_EQ((a.rig.cameras[c].cam_from_world.translation - b.rig.cameras[c].cam_from_world.translation).norm(), 0);
  }
}

}  // namespace
}  // namespace mvstudio::calib
