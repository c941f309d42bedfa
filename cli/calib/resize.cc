#include "geometry/rig/resize.h"

#include <algorithm>
#include <cstdio>
#include <map>

#include "cli/calib/calib.h"
#include "cli/program/input_flags.h"
#include "cli/program/options.h"
#include "cli/program/output_guard.h"
#include "core/error.h"
#include "core/format.h"
#include "geometry/rig/rig_io.h"
#include "stages/calib/calibration_use.h"
#include "stages/input/calib_read.h"

namespace mvstudio::cli {
namespace {

using geometry::PixelArea;
using geometry::Rig;
using nlohmann::ordered_json;

struct Arguments {
  std::string calibration, size, out;
  std::vector<std::string> camera_size, crop;
};

stages::ImageSize SizeOf(const std::string& flag, const std::string& text) {
  stages::ImageSize size;
  try {
    FromString(text, &size);
  } catch (const UsageError&) {
    throw UsageError(flag + " " + text + ": expected WIDTHxHEIGHT in px, e.g. 1920x1080");
  }
  return size;
}

PixelArea AreaOf(const std::string& text) {
  PixelArea area;
  char end = 0;
  const int read = std::sscanf(text.c_str(), "%d,%d,%d,%d%c", &area.x, &area.y, &area.width_px, &area.height_px,
                               &end);  // NOLINT(cert-err34-c)
  constexpr int kMost = 1 << 20;
  const bool sane = std::max({std::abs(area.x), std::abs(area.y), area.width_px, area.height_px}) < kMost;
  if (read != 4 || area.width_px <= 0 || area.height_px <= 0 || !sane)
    throw UsageError("--crop " + text + ": expected X,Y,WIDTH,HEIGHT in px of the calibrated image, e.g. 240,0,1440,1080");
  return area;
}

size_t CameraOf(const Rig& rig, const std::string& flag, const std::string& name) {
  const int found = rig.Find(name);
  if (found < 0) throw UsageError(flag + ": there is no camera '" + name + "' in the calibration");
  return static_cast<size_t>(found);
}

/// Of the cameras whose images change; those that are cropped have the crop's size unless another is given.
std::map<size_t, stages::ImageSize> SizesOf(const Arguments& arguments, const Rig& rig,
                                            const std::map<size_t, PixelArea>& areas) {
  std::map<size_t, stages::ImageSize> sizes;
  for (const std::string& text : arguments.crop) {
    const size_t end = text.find('=');
    for (const auto& [camera, area] : areas) {
      if (end == std::string::npos || rig.cameras[camera].camera.name == text.substr(0, end))
        sizes[camera] = {area.width_px, area.height_px};
    }
  }
  for (size_t c = 0; c < rig.cameras.size() && !arguments.size.empty(); ++c) sizes[c] = SizeOf("--size", arguments.size);
  for (const std::string& text : arguments.camera_size) {
    const auto [name, size] = SplitNamePath("--camera-size", text);
    sizes[CameraOf(rig, "--camera-size", name)] = SizeOf("--camera-size " + name + "=", size);
  }
  return sizes;
}

/// The area of each camera's image that the new images show; the whole image unless given.
std::map<size_t, PixelArea> AreasOf(const Arguments& arguments, const Rig& rig) {
  std::map<size_t, PixelArea> areas;
  for (size_t c = 0; c < rig.cameras.size(); ++c)
    areas[c] = {0, 0, rig.cameras[c].camera.width_px, rig.cameras[c].camera.height_px};
  for (const std::string& text : arguments.crop) {
    if (text.find('=') != std::string::npos) continue;
    for (auto& [camera, area] : areas) area = AreaOf(text);
  }
  for (const std::string& text : arguments.crop) {
    if (text.find('=') == std::string::npos) continue;
    const auto [name, area] = SplitNamePath("--crop", text);
    areas[CameraOf(rig, "--crop", name)] = AreaOf(area);
  }
  return areas;
}

void Check(const geometry::Camera& camera, const PixelArea& area, const stages::ImageSize& size) {
  const std::string sizes =
      Format("camera %s: ", camera.name.c_str()) +
      Format("%d x %d pixels of its %d x %d image", area.width_px, area.height_px, camera.width_px, camera.height_px) +
      Format(" do not become %d x %d", size.width_px, size.height_px);
  const bool turned = (size.width_px < size.height_px) != (area.width_px < area.height_px);
  if (!geometry::KeepsAspect(area, size.width_px, size.height_px)) {
    throw UsageError(sizes +
                     (turned ? " by scaling: the images are turned by a quarter; turn the footage back"
                             : " by scaling: the shape differs; say with --crop which part of the calibrated image they show"));
  }
  const bool apart =
      area.x >= camera.width_px || area.y >= camera.height_px || area.x + area.width_px <= 0 || area.y + area.height_px <= 0;
  if (apart) throw UsageError(sizes + ": the crop lies outside the calibrated image");
}

ordered_json Row(const geometry::Camera& before, const geometry::Camera& after) {
  return {{"name", after.name},
          {"old_size_px", {before.width_px, before.height_px}},
          {"size_px", {after.width_px, after.height_px}},
          {"fx", after.fx()},
          {"fy", after.fy()},
          {"cx", after.cx()},
          {"cy", after.cy()}};
}

CommandResult Resize(const Arguments& arguments) {
  CommandResult result;
  const OutputFiles place({arguments.out}, {arguments.calibration});
  calib::ImportedRig given = stages::ReadCalibrationFiles({arguments.calibration}, {});
  stages::AddNotes(given.notes, &result);
  result.inputs.push_back(arguments.calibration);
  Rig& rig = given.rig;
  const std::map<size_t, PixelArea> areas = AreasOf(arguments, rig);
  const std::map<size_t, stages::ImageSize> sizes = SizesOf(arguments, rig, areas);
  if (sizes.empty()) {
    throw UsageError(
        "give the new size: --size WIDTHxHEIGHT for all cameras, or --camera-size NAME=WIDTHxHEIGHT; or --crop alone, whose "
        "size "
        "it then is");
  }
  for (const auto& [c, size] : sizes) Check(rig.cameras[c].camera, areas.at(c), size);
  ordered_json& rows = result.metrics["cameras"] = ordered_json::array();
  for (const auto& [c, size] : sizes) {
    const geometry::Camera before = rig.cameras[c].camera;
    const geometry::PixelMap map = geometry::MapOfArea(areas.at(c), size.width_px, size.height_px);
    geometry::ResizeCamera(c, map, size.width_px, size.height_px, &rig);
    const geometry::Camera& after = rig.cameras[c].camera;
    rows.push_back(Row(before, after));
    result.text += Format("%s: %d x %d -> ", after.name.c_str(), before.width_px, before.height_px) +
                   Format("%d x %d, fx %.2f, fy %.2f px\n", after.width_px, after.height_px, after.fx(), after.fy());
  }
  geometry::WriteRig(rig, arguments.out);
  result.outputs.push_back({arguments.out, "calibration"});
  stages::AddImplausible(rig, &result);
  return result;
}

}  // namespace

void RegisterCalibResize(CLI::App& calib, Registry& registry) {
  const auto arguments = std::make_shared<Arguments>();
  CLI::App* sub =
      calib.add_subcommand("resize", "Lenses for images of another resolution, or for a crop of the calibrated images");
  AddOption(sub, "CALIB", arguments->calibration, "calibration to change")->required();
  AddOption(sub, "--size", arguments->size, "WIDTHxHEIGHT px of the new images, for every camera; that of --crop unless given");
  AddOption(sub, "--camera-size", arguments->camera_size, "NAME=WIDTHxHEIGHT, for one camera; may be repeated")->take_all();
  AddOption(
      sub, "--crop", arguments->crop,
      "X,Y,WIDTH,HEIGHT, or NAME=X,Y,WIDTH,HEIGHT: the part of the calibrated image that the new images show, in its px; it "
      "may reach beyond it; the whole image unless given")
      ->take_all();
  AddOutput(sub, "--out", arguments->out, OutputKind::kFile, "file to write")->required();
  registry.Add(sub, "calib resize", [arguments](CommandContext&) { return Resize(*arguments); });
}

}  // namespace mvstudio::cli
