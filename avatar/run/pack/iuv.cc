#include "avatar/run/pack/iuv.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "dataset/views/crop.h"

namespace mvstudio::avatar {
namespace {

constexpr int kMaxPart = 24;

/// Channels of I, U and V in an RGB image.
struct Channels {
  int part, u, v;
};

bool HoldsParts(const Image& image, int channel) {
  for (size_t i = channel; i < image.pixels.size(); i += 3) {
    if (image.pixels[i] > kMaxPart) return false;
  }
  return true;
}

Channels ChannelsOf(const Image& image, const std::string& path) {
  if (HoldsParts(image, 2)) return {2, 1, 0};
  if (HoldsParts(image, 0)) return {0, 1, 2};
  throw FormatError(path, "", "neither blue nor red holds parts 0 to 24: not an IUV map of DensePose");
}

}  // namespace

std::string IuvPath(const std::string& folder, const std::string& camera, const std::string& image_path) {
  return folder + "/" + camera + "/" + std::filesystem::path(image_path).stem().string() + ".png";
}

body::PartUvMap ReadIuv(const std::string& path, const geometry::RigCamera& camera, const geometry::RigCamera& crop) {
  const Image image = dataset::ReadImage(path);
  if (image.width != camera.camera.width_px || image.height != camera.camera.height_px) {
    throw FormatError(path, "",
                      "is " + std::to_string(image.width) + "x" + std::to_string(image.height) + ", images of camera " +
                          camera.camera.name + " are " + std::to_string(camera.camera.width_px) + "x" +
                          std::to_string(camera.camera.height_px));
  }
  const Channels channels = ChannelsOf(image, path);
  const dataset::ResampleMap map(camera, crop);
  body::PartUvMap out;
  out.width = crop.camera.width_px, out.height = crop.camera.height_px;
  const size_t area = static_cast<size_t>(out.width) * out.height;
  out.part.assign(area, 0), out.u.assign(area, 0), out.v.assign(area, 0);
  out.depth_m.assign(area, std::numeric_limits<float>::infinity());
  for (size_t i = 0; i < area; ++i) {
    const Eigen::Vector2d px = map.SourceOf({static_cast<double>(i % out.width), static_cast<double>(i / out.width)});
    if (!(px.x() > -0.5 && px.y() > -0.5 && px.x() < image.width - 0.5 && px.y() < image.height - 0.5)) continue;
    const uint8_t* iuv = image.Pixel(static_cast<int>(std::lround(px.x())), static_cast<int>(std::lround(px.y())));
    out.part[i] = iuv[channels.part];
    if (out.part[i] == 0) continue;
    out.u[i] = static_cast<float>(iuv[channels.u]) / 255, out.v[i] = static_cast<float>(iuv[channels.v]) / 255;
  }
  return out;
}

}  // namespace mvstudio::avatar
