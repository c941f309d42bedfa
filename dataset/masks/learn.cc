#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "core/check.h"
#include "dataset/masks/limbs.h"
#include "dataset/masks/patch.h"

namespace mvstudio::dataset {
namespace {

/// Every `step`-th colour of a frame where `select(i)` holds.
template <class Select>
void CollectColours(const Image& rgb, int step, const Select& select, std::vector<Eigen::Vector3f>* colours) {
  for (int y = 0; y < rgb.height; y += step) {
    for (int x = 0; x < rgb.width; x += step) {
      if (!select(size_t(y) * rgb.width + x)) continue;
      const uint8_t* p = rgb.Pixel(x, y);
      colours->emplace_back(p[0], p[1], p[2]);
    }
  }
}

ColourMixture FitSubset(const std::vector<Eigen::Vector3f>& colours, int num_components) {
  constexpr size_t kMost = 20000;
  const size_t stride = std::max<size_t>(1, colours.size() / kMost);
  Eigen::Matrix3Xf rgb(3, static_cast<Eigen::Index>((colours.size() + stride - 1) / stride));
  for (Eigen::Index i = 0; i < rgb.cols(); ++i) rgb.col(i) = colours[static_cast<size_t>(i) * stride];
  return FitColours(rgb, num_components);
}

struct Regions {
  std::vector<Image> surely, maybe, around;  // per frame: 255 where a person is / may be / within reach
};

CameraMaskModel ModelFromRegions(const std::vector<Image>& frames, const Regions& regions, const BackgroundModel* plate,
                                 const MaskOptions& options) {
  CameraMaskModel model;
  model.background = plate ? *plate : LearnBackground(frames, regions.maybe, options);
  std::vector<Eigen::Vector3f> person, surroundings;
  const int step = std::max(1, std::max(frames[0].width, frames[0].height) / 480);
  for (size_t f = 0; f < frames.size(); ++f) {
    CollectColours(
        frames[f], step, [&](size_t i) { return regions.surely[f].pixels[i] != 0; }, &person);
    CollectColours(
        frames[f], step, [&](size_t i) { return regions.around[f].pixels[i] && !regions.maybe[f].pixels[i]; }, &surroundings);
  }
  model.person = FitSubset(person, 8);
  model.surroundings = FitSubset(surroundings, 8);
  return model;
}

}  // namespace

namespace {

/// The plate's model, or nothing.
std::optional<BackgroundModel> PlateModel(const Image* plate, const Image& frame, const MaskOptions& options) {
  if (!plate) return std::nullopt;
  MVS_CHECK(plate->width == frame.width && plate->height == frame.height, "the clean plate has another size than the frames");
  return BackgroundFromPlate(*plate, options);
}

}  // namespace

CameraMaskModel LearnCamera(const std::vector<Image>& frames, const std::vector<ProjectedBody>& bodies, const Image* plate,
                            const MaskOptions& options) {
  MVS_CHECK(!frames.empty() && frames.size() == bodies.size(), frames.size() << " frames, " << bodies.size() << " bodies");
  const int w = frames[0].width, h = frames[0].height;
  const std::optional<BackgroundModel> plate_model = PlateModel(plate, frames[0], options);
  const BackgroundModel* known_plate = plate_model ? &*plate_model : nullptr;
  Regions regions;
  for (const ProjectedBody& body : bodies) {
    regions.surely.push_back(BodyRegion(body, w, h, -0.02));
    regions.maybe.push_back(BodyRegion(body, w, h, 0.5 * options.reach_m));
    regions.around.push_back(BodyRegion(body, w, h, options.reach_m + 0.1));
  }
  const CameraMaskModel first = ModelFromRegions(frames, regions, known_plate, options);
  for (size_t f = 0; f < frames.size(); ++f) {
    if (bodies[f].empty()) continue;
    const Image mask = SegmentBody(frames[f], bodies[f], first, options).mask;
    const int margin_px = std::max(2, int(std::lround(0.025 * internal::TypicalPxPerM(bodies[f]))));
    const Image near_bones = BodyRegion(bodies[f], w, h, 0.03);
    regions.surely[f] = mask;
    regions.maybe[f] = internal::Dilated(mask, margin_px);
    for (size_t i = 0; i < near_bones.pixels.size(); ++i) regions.maybe[f].pixels[i] |= near_bones.pixels[i];
  }
  return ModelFromRegions(frames, regions, known_plate, options);
}

CameraMaskModel LearnCameraFromMasks(const std::vector<Image>& frames, const std::vector<Image>& surely,
                                     const std::vector<Image>& maybe, const Image* plate, const MaskOptions& options) {
  MVS_CHECK(!frames.empty() && frames.size() == surely.size() && frames.size() == maybe.size(),
            frames.size() << " frames, " << surely.size() << " and " << maybe.size() << " masks");
  const std::optional<BackgroundModel> plate_model = PlateModel(plate, frames[0], options);
  Regions regions{surely, maybe, {}};
  const int reach_px = std::max(4, std::max(frames[0].width, frames[0].height) / 16);
  for (const Image& mask : maybe) regions.around.push_back(internal::Dilated(mask, reach_px));
  return ModelFromRegions(frames, regions, plate_model ? &*plate_model : nullptr, options);
}

}  // namespace mvstudio::dataset
