#include "calib/lens/evidence.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;

std::optional<double> Evidence(const testing::SceneOptions& options) {
  const testing::Scene scene = testing::MakeScene(options);
  std::vector<int64_t> frames;
  const std::vector<View> views = MakeViews({scene.board}, scene.detections, &frames);
  geometry::Camera camera = scene.truth.cameras[0];
  camera.params.setZero();
  return FocalEvidence(CalibrateMono(camera, views, BundleOptions()));
}

TEST(FocalEvidence, TellsParallelBoardsFromTiltedOnes) {
  testing::SceneOptions options;
  options.num_cameras = 1;
  for (LensModel model : {LensModel::kPinhole, LensModel::kBrown1, LensModel::kBrown4, LensModel::kBrown5}) {
    for (double noise : {0.0, 0.1, 1.0}) {
      for (uint64_t seed : {1, 2, 3}) {
        options.model = model, options.noise_px = noise, options.seed = seed;
        options.max_tilt_rad = 0;
        const auto parallel = Evidence(options);
        if (parallel) {
          EXPECT_LT(*parallel, kMinFocalEvidence) << geometry::ToString(model) << ", noise " << noise;
        }
        options.max_tilt_rad = 0.6;
        const auto tilted = Evidence(options);
        ASSERT_TRUE(tilted.has_value());
        EXPECT_GT(*tilted, 20 * kMinFocalEvidence) << geometry::ToString(model) << ", noise " << noise;
      }
    }
  }
}

TEST(FocalEvidence, HasNoneForWideModelsAndFailures) {
  MonoSolution failed;
  failed.status = Status::kDegenerate;
  EXPECT_FALSE(FocalEvidence(failed).has_value());
  testing::SceneOptions options;
  options.num_cameras = 1;
  options.model = LensModel::kKannalaBrandt4;
  EXPECT_FALSE(Evidence(options).has_value());
}

}  // namespace
}  // namespace mvstudio::calib
