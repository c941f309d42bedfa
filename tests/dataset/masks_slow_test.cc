#include "core/parallel.h"
#include "dataset/image_io.h"
#include "dataset/masks.h"
#include "dataset/panoptic.h"
#include "tests/dataset/dataset_test_util.h"

namespace mvstudio::dataset {
namespace {

/// Masks made from the pictures and joints of a path-traced person against its exact ones: ten cameras, every tenth frame.
TEST(MasksSlow, AgreeWithExactMasks) {
  MVS_NEEDS_DATA("person_a");
  const PanopticDataset dataset = OpenPanopticDataset(DataFolder("person_a"));
  const int num_cameras = static_cast<int>(dataset.rig.cameras.size());
  std::vector<double> mean_iou(num_cameras, 0), worst_iou(num_cameras, 1);
  ParallelFor(num_cameras, 2, [&](int64_t c) {
    const geometry::RigCamera& camera = dataset.rig.cameras[c];
    std::vector<Image> frames;
    std::vector<ProjectedBody> bodies;
    for (int i = 0; i < 24; ++i) {
      const int frame = dataset.frames[5 * i + 2];
      frames.push_back(ReadImage(dataset.ImagePath(camera.camera.name, frame)));
      bodies.push_back(ProjectBody(dataset.poses.at(frame), camera));
    }
    const CameraMaskModel model = LearnCamera(frames, bodies, nullptr);
    for (int i = 0; i < 120; i += 10) {
      const Image rgb = ReadImage(dataset.ImagePath(camera.camera.name, i));
      const Image truth = ReadImage(dataset.MaskPath(camera.camera.name, i), true);
      const Image mask = SegmentBody(rgb, ProjectBody(dataset.poses.at(i), camera), model).mask;
      double both = 0, either = 0;
      for (size_t p = 0; p < mask.pixels.size(); ++p)
        both += mask.pixels[p] && truth.pixels[p], either += mask.pixels[p] || truth.pixels[p];
      mean_iou[c] += both / either / 12;
      worst_iou[c] = std::min(worst_iou[c], both / either);
    }
  });
  double mean = 0;
  for (int c = 0; c < num_cameras; ++c) {
    EXPECT_GT(mean_iou[c], 0.955) << dataset.rig.cameras[c].camera.name;
    EXPECT_GT(worst_iou[c], 0.93) << dataset.rig.cameras[c].camera.name;
    mean += mean_iou[c] / num_cameras;
  }
  EXPECT_GT(mean, 0.965);
  RecordProperty("mean_iou", std::to_string(mean));
}

}  // namespace
}  // namespace mvstudio::dataset
