#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/disk/files.h"
#include "core/error.h"
#include "stages/view/scene_parts.h"

/// Which images were held out from an avatar's training, from what `avatar eval` left.
namespace mvstudio::stages {
namespace {

using nlohmann::json;

constexpr double kMostSteps = 1e9;

/// Damaged files count as none.
json ParsedFile(const std::string& path) {
  std::error_code none;
  if (!std::filesystem::is_regular_file(path, none)) return {};
  return json::parse(ReadFile(path), nullptr, false);
}

json ListAt(const json& parsed, const char* place) {
  const json::json_pointer at(place);
  return parsed.is_object() && parsed.contains(at) && parsed[at].is_array() ? parsed[at] : json::array();
}

std::optional<int> StepOf(const json& value) {
  const bool fits = value.is_number() && value.get<double>() >= 0 && value.get<double>() < kMostSteps;
  return fits ? std::optional(value.get<int>()) : std::nullopt;
}

}  // namespace

void ReadHeldOut(const std::string& folder, Scene* scene) {
  for (const char* name : {"avatar_eval.result.json", "protocol.json"}) RequireInside(folder + "/" + name, scene->root);
  const json result = ParsedFile(folder + "/avatar_eval.result.json"), protocol = ParsedFile(folder + "/protocol.json");
  for (const json& frame : ListAt(protocol, "/protocol/holdout/frames")) {
    if (const auto step = StepOf(frame)) scene->held_out[*step];
  }
  for (const json& image : ListAt(result, "/metrics/pictures")) {
    if (!image.is_object() || !image.contains("frame") || !image.contains("camera") || !image["camera"].is_string()) continue;
    const double ssim = image.contains("ssim") && image["ssim"].is_number() ? image["ssim"].get<double>() : std::nan("");
    const auto step = StepOf(image["frame"]);
    if (!step) continue;
    const auto camera = image["camera"].get<std::string>();
    scene->held_out[*step][camera] = ssim;
    if (!image.contains("path") || !image["path"].is_string()) continue;
    const std::string name = std::filesystem::path(image["path"].get<std::string>()).filename().string();
    const std::string drawn = folder + "/eval/" + name;  // the run may have been moved
    std::error_code none;
    if (std::filesystem::is_regular_file(drawn, none)) scene->scored[*step][camera] = drawn;
  }
}

}  // namespace mvstudio::stages
