#include "geometry/rig/resize.h"

#include <algorithm>
#include <cstdio>
#include <map>

#include "core/disk/output.h"
#include "core/error.h"
#include "core/format.h"
#include "geometry/rig/rig_io.h"
#include "stages/calib_files/run.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

using geometry::PixelArea;
using geometry::Rig;

ImageSize ParseImageSize(const std::string& flag, const std::string& text) {
  ImageSize size;
  try {
    FromString(text, &size);
  } catch (const UsageError&) {
    throw UsageError(flag + " " + text + ": expected WIDTHxHEIGHT in px, e.g. 1920x1080");
  }
  return size;
}

PixelArea ParsePixelArea(const std::string& text) {
  PixelArea area;
  char end = 0;
  const int read = std::sscanf(text.c_str(), "%d,%d,%d,%d%c", &area.x, &area.y, &area.width_px, &area.height_px,
                               &end);  // NOLINT(cert-err34-c)
  constexpr int kMost = 1 << 20;
  const bool sane = std::max({std::abs(area.x), std::abs(area.y), area.width_px, area.height_px}) < kMost;
  if (read != 4 || area.width_px <= 0 || area.height_px <= 0 || !sane)
    throw UsageError("option 'crop' " + text +
                     ": expected X,Y,WIDTH,HEIGHT in px of the calibrated image, e.g. 240,0,1440,1080");
  return area;
}

size_t CameraNumber(const Rig& rig, const std::string& flag, const std::string& name) {
  const int found = rig.Find(name);
  if (found < 0) throw UsageError(flag + ": there is no camera '" + name + "' in the calibration");
  return static_cast<size_t>(found);
}

/// Of the cameras whose images change; those that are cropped have the crop's size unless another is given.
std::map<size_t, ImageSize> NewSizesOf(const CalibResizeOptions& options, const Rig& rig,
                                       const std::map<size_t, PixelArea>& areas) {
  std::map<size_t, ImageSize> sizes;
  for (const std::string& text : options.crop) {
    const size_t end = text.find('=');
    for (const auto& [camera, area] : areas) {
      if (end == std::string::npos || rig.cameras[camera].camera.name == text.substr(0, end))
        sizes[camera] = {area.width_px, area.height_px};
    }
  }
  for (size_t c = 0; c < rig.cameras.size() && !options.size.empty(); ++c)
    sizes[c] = ParseImageSize("option 'size'", options.size);
  for (const std::string& text : options.camera_size) {
    const auto [name, size] = SplitNamePath("option 'camera-size'", text);
    sizes[CameraNumber(rig, "option 'camera-size'", name)] = ParseImageSize("option 'camera-size' " + name + "=", size);
  }
  return sizes;
}

/// The area of each camera's image that the new images show; the whole image unless given.
std::map<size_t, PixelArea> ShownAreasOf(const CalibResizeOptions& options, const Rig& rig) {
  std::map<size_t, PixelArea> areas;
  for (size_t c = 0; c < rig.cameras.size(); ++c)
    areas[c] = {0, 0, rig.cameras[c].camera.width_px, rig.cameras[c].camera.height_px};
  for (const std::string& text : options.crop) {
    if (text.find('=') != std::string::npos) continue;
    for (auto& [camera, area] : areas) area = ParsePixelArea(text);
  }
  for (const std::string& text : options.crop) {
    if (text.find('=') == std::string::npos) continue;
    const auto [name, area] = SplitNamePath("option 'crop'", text);
    areas[CameraNumber(rig, "option 'crop'", name)] = ParsePixelArea(area);
  }
  return areas;
}

void RequireShape(const geometry::Camera& camera, const PixelArea& area, const ImageSize& size) {
  const std::string sizes =
      Format("camera %s: ", camera.name.c_str()) +
      Format("%d x %d pixels of its %d x %d image", area.width_px, area.height_px, camera.width_px, camera.height_px) +
      Format(" do not become %d x %d", size.width_px, size.height_px);
  const bool rotated = (size.width_px < size.height_px) != (area.width_px < area.height_px);
  if (!geometry::KeepsAspect(area, size.width_px, size.height_px)) {
    throw UsageError(
        sizes + (rotated
                     ? " by scaling: the images are turned by a quarter; turn the footage back"
                     : " by scaling: the shape differs; say with option 'crop' which part of the calibrated image they show"));
  }
  const bool apart =
      area.x >= camera.width_px || area.y >= camera.height_px || area.x + area.width_px <= 0 || area.y + area.height_px <= 0;
  if (apart) throw UsageError(sizes + ": the crop lies outside the calibrated image");
}

}  // namespace

CalibResizeReport RunCalibResize(const CalibResizeOptions& options) {
  CalibResizeReport report;
  report.out = options.out;
  const OutputFiles place({options.out}, {options.calibration});
  calib::ImportedRig given = ReadCalibrationFiles({options.calibration}, {});
  AddNotes(given.notes, &report.notes);
  report.notes.inputs.push_back(options.calibration);
  Rig& rig = given.rig;
  const std::map<size_t, PixelArea> areas = ShownAreasOf(options, rig);
  const std::map<size_t, ImageSize> sizes = NewSizesOf(options, rig, areas);
  if (sizes.empty()) {
    throw UsageError(
        "give the new size: option 'size' WIDTHxHEIGHT for all cameras, or option 'camera-size' NAME=WIDTHxHEIGHT; or option "
        "'crop' alone, whose size it then is");
  }
  for (const auto& [c, size] : sizes) RequireShape(rig.cameras[c].camera, areas.at(c), size);
  for (const auto& [c, size] : sizes) {
    const geometry::Camera before = rig.cameras[c].camera;
    const geometry::PixelMap map = geometry::MapOfArea(areas.at(c), size.width_px, size.height_px);
    geometry::ResizeCamera(c, map, size.width_px, size.height_px, &rig);
    report.cameras.push_back({before, rig.cameras[c].camera});
  }
  geometry::WriteRig(rig, options.out);
  AddImplausible(rig, &report.notes);
  return report;
}

}  // namespace mvstudio::stages
