#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>

#include "core/parallel.h"
#include "dataset/footage/image_io.h"
#include "dataset/masks/masks.h"
#include "dataset/masks/sheet.h"
#include "dataset/panoptic/panoptic.h"
#include "tests/dataset/dataset_test_util.h"

namespace mvstudio::dataset {
namespace {

/// The whole take with MVSTUDIO_MASK_EVERY=1.
int EveryNth() {
  const char* text = std::getenv("MVSTUDIO_MASK_EVERY");
  return text ? std::max(1, std::atoi(text)) : 8;
}

/// MVSTUDIO_MASK_OPTIONS="mask-outline=0 mask-noise=2": other options, to measure what they are worth.
MaskOptions OptionsFromEnvironment() {
  MaskOptions options;
  const char* text = std::getenv("MVSTUDIO_MASK_OPTIONS");
  std::istringstream words(text ? text : "");
  for (std::string word; words >> word;) {
    const auto [name, value] = std::make_pair(word.substr(0, word.find('=')), std::atof(word.c_str() + word.find('=') + 1));
    VisitFields(
        [&name = name, &value = value](const std::string& field, auto& option, const std::string&) {
          if (field == name) option = static_cast<std::decay_t<decltype(option)>>(value);
        },
        options);
  }
  return options;
}

/// Processor time of this thread, which other programs do not lengthen.
double ThreadMs() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e3 * double(t.tv_sec) + 1e-6 * double(t.tv_nsec);
}

struct Score {
  double iou_sum = 0, worst = 1, ms = 0;
  int images = 0, worst_frame = -1;
  double too_much_px = 0, too_little_px = 0;          ///< beside the outline and elsewhere
  double far_too_much_px = 0, far_too_little_px = 0;  ///< farther than 2 px from the exact outline
};

bool NearOther(const Image& truth, int x, int y, int reach) {
  const uint8_t own = *truth.Pixel(x, y);
  for (int v = std::max(0, y - reach); v <= std::min(truth.height - 1, y + reach); ++v) {
    for (int u = std::max(0, x - reach); u <= std::min(truth.width - 1, x + reach); ++u) {
      if (*truth.Pixel(u, v) != own) return true;
    }
  }
  return false;
}

void AddImage(const Image& mask, const Image& truth, int frame, Score* score) {
  double both = 0, either = 0;
  for (int y = 0; y < mask.height; ++y) {
    for (int x = 0; x < mask.width; ++x) {
      const bool m = *mask.Pixel(x, y), t = *truth.Pixel(x, y);
      both += m && t, either += m || t;
      if (m == t) continue;
      const bool near = NearOther(truth, x, y, 2);
      (m ? score->too_much_px : score->too_little_px) += 1;
      if (!near) (m ? score->far_too_much_px : score->far_too_little_px) += 1;
    }
  }
  const double iou = both / either;
  score->iou_sum += iou;
  ++score->images;
  if (iou < score->worst) score->worst = iou, score->worst_frame = frame;
}

Score ScoreCamera(const PanopticDataset& dataset, const geometry::RigCamera& camera, const MaskOptions& options) {
  std::vector<Image> frames;
  std::vector<ProjectedBody> bodies;
  for (int i = 0; i < options.background_frames; ++i) {
    const int frame = dataset.frames[(2 * i + 1) * 120 / (2 * options.background_frames)];
    frames.push_back(ReadImage(dataset.ImagePath(camera.camera.name, frame)));
    bodies.push_back(ProjectBody(dataset.poses.at(frame), camera, options));
  }
  const CameraMaskModel model = LearnCamera(frames, bodies, nullptr, options);
  Score score;
  const char* out = std::getenv("MVSTUDIO_MASK_OUT");  // folder for images of what is wrong
  std::vector<SheetTile> tiles;
  for (int i = 0; i < 120; i += EveryNth()) {
    const Image rgb = ReadImage(dataset.ImagePath(camera.camera.name, i));
    const Image truth = ReadImage(dataset.MaskPath(camera.camera.name, i), true);
    const double start = ThreadMs();
    const Image mask = SegmentBody(rgb, ProjectBody(dataset.poses.at(i), camera, options), model, options).mask;
    score.ms += ThreadMs() - start;
    AddImage(mask, truth, i, &score);
    if (out) tiles.push_back({rgb, mask, truth});
  }
  if (out) WriteImage(ContactSheet(tiles, 4, 480, true), std::string(out) + "/" + camera.camera.name + ".png");
  return score;
}

/// Masks made from the images and joints of a path-traced person against its exact ones: ten cameras, every eighth frame.
TEST(MasksSlow, AgreeWithExactMasks) {
  MVS_NEEDS_DATA("person_a");
  const PanopticDataset dataset = OpenPanopticDataset(DataFolder("person_a"));
  const char* first = std::getenv("MVSTUDIO_MASK_CAMERAS");  // how many, to measure options on a few
  const int num_cameras = std::min<int>(first ? std::max(1, std::atoi(first)) : 1000, int(dataset.rig.cameras.size()));
  const MaskOptions options = OptionsFromEnvironment();
  std::vector<Score> scores(num_cameras);
  ParallelFor(num_cameras, 2, [&](int64_t c) { scores[c] = ScoreCamera(dataset, dataset.rig.cameras[c], options); });
  double mean = 0, worst = 1;
  std::printf("camera  mean IoU  worst (frame)   too much (far)  too little (far), px a picture   ms\n");
  for (int c = 0; c < num_cameras; ++c) {
    const Score& s = scores[c];
    const double n = s.images;
    std::printf("%s   %.4f    %.4f (%3d)    %5.1f (%5.1f)   %5.1f (%5.1f)   %.0f\n", dataset.rig.cameras[c].camera.name.c_str(),
                s.iou_sum / n, s.worst, s.worst_frame, s.too_much_px / n, s.far_too_much_px / n, s.too_little_px / n,
                s.far_too_little_px / n, s.ms / n);
    EXPECT_GT(s.iou_sum / n, 0.955) << dataset.rig.cameras[c].camera.name;
    EXPECT_GT(s.worst, 0.93) << dataset.rig.cameras[c].camera.name << " frame " << s.worst_frame;
    mean += s.iou_sum / n / num_cameras;
    worst = std::min(worst, s.worst);
  }
  std::printf("mean %.4f, worst %.4f\n", mean, worst);
  EXPECT_GT(mean, 0.97);
  RecordProperty("mean_iou", std::to_string(mean));
}

}  // namespace
}  // namespace mvstudio::dataset
