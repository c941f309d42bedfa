#include "avatar/io/run_config.h"

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "avatar/bone_lists.h"
#include "core/error.h"
#include "core/files.h"

namespace mvstudio::avatar {
namespace {

using Json = nlohmann::ordered_json;
constexpr const char* kGirthNames[kNumGirthGroups] = {"trunk", "head", "arms", "legs"};

Json ParseFile(const std::string& path) {
  const std::string text = ReadFile(path);
  constexpr size_t kMaxBytes = 16 << 20;  // a depth bomb cannot fit a config that stays small
  if (text.size() > kMaxBytes) throw FormatError(path, "", "is larger than any configuration");
  const auto shallow = [](int depth, Json::parse_event_t, Json&) {
    if (depth > 16) throw std::length_error("nested too deeply");
    return true;
  };
  try {
    return Json::parse(text, shallow);
  } catch (const std::exception& error) {
    throw FormatError(path, "", std::string("not valid JSON (") + error.what() + "); was the training interrupted?");
  }
}

// Member `pointer` of the file as a T.
template <class T>
T Get(const Json& json, const std::string& path, const std::string& pointer) {
  const Json::json_pointer at(pointer);
  if (!json.contains(at)) throw FormatError(path, pointer, "is missing");
  try {
    return json.at(at).get<T>();
  } catch (const std::exception& error) {
    throw FormatError(path, pointer, error.what());
  }
}

}  // namespace

void WriteRunConfig(const RunConfig& config, const std::string& path) {
  Json girth;
  for (int g = 0; g < kNumGirthGroups; ++g) girth[kGirthNames[g]] = config.shape.girth[g];
  const Json json = {{"schema", kRunConfigSchema},
                     {"dataset", config.dataset},
                     {"crop",
                      {{"size_px", config.pack.size_px},
                       {"fill", config.pack.fill},
                       {"half_extent_m", config.half_extent_m},
                       {"person", config.pack.person},
                       {"joints", config.pack.num_joints},
                       {"pose3d", config.pack.pose3d}}},
                     {"split",
                      {{"train_cameras", config.split.train_cameras},
                       {"train_frames", config.split.train_frames},
                       {"holdout_cameras", config.split.holdout_cameras},
                       {"holdout_frames", config.split.holdout_frames},
                       {"validation_cameras", config.split.validation_cameras},
                       {"validation_frames", config.split.validation_frames}}},
                     {"template",
                      {{"girth", girth},
                       {"input_px", config.pack.template_input_px},
                       {"iou", std::isfinite(config.template_iou) ? Json(config.template_iou) : Json()},
                       {"iuv", config.pack.iuv}}}};
  WriteFileAtomic(path, json.dump(1) + "\n");
}

RunConfig ReadRunConfig(const std::string& path) {
  const Json json = ParseFile(path);
  if (!json.is_object() || Get<std::string>(json, path, "/schema") != kRunConfigSchema) {
    throw FormatError(path, "/schema", std::string("is not ") + kRunConfigSchema);
  }
  RunConfig config;
  config.dataset = Get<std::string>(json, path, "/dataset");
  config.pack.size_px = Get<int>(json, path, "/crop/size_px");
  config.pack.fill = Get<double>(json, path, "/crop/fill");
  config.pack.person = Get<int>(json, path, "/crop/person");
  config.half_extent_m = Get<double>(json, path, "/crop/half_extent_m");
  if (json.contains(Json::json_pointer("/crop/joints"))) {
    config.pack.num_joints = Get<int>(json, path, "/crop/joints");
    config.pack.pose3d = Get<std::string>(json, path, "/crop/pose3d");
    if (!IsJointList(config.pack.num_joints)) throw FormatError(path, "/crop/joints", "must be 19, 25, 131 or 137");
  }
  if (!(config.half_extent_m > 0)) throw FormatError(path, "/crop/half_extent_m", "must be positive");
  config.pack.half_extent_m = config.half_extent_m;
  config.split.train_cameras = Get<std::vector<std::string>>(json, path, "/split/train_cameras");
  config.split.train_frames = Get<std::vector<int>>(json, path, "/split/train_frames");
  config.split.holdout_cameras = Get<std::vector<std::string>>(json, path, "/split/holdout_cameras");
  config.split.holdout_frames = Get<std::vector<int>>(json, path, "/split/holdout_frames");
  if (json.contains(Json::json_pointer("/split/validation_cameras"))) {
    config.split.validation_cameras = Get<std::vector<std::string>>(json, path, "/split/validation_cameras");
    config.split.validation_frames = Get<std::vector<int>>(json, path, "/split/validation_frames");
  }
  if (config.split.train_cameras.empty()) throw FormatError(path, "/split/train_cameras", "is empty");
  if (config.split.train_frames.empty()) throw FormatError(path, "/split/train_frames", "is empty");
  for (int g = 0; g < kNumGirthGroups; ++g)
    config.shape.girth[g] = Get<double>(json, path, std::string("/template/girth/") + kGirthNames[g]);
  if (json.contains(Json::json_pointer("/template/iuv"))) config.pack.iuv = Get<std::string>(json, path, "/template/iuv");
  if (json.contains(Json::json_pointer("/template/input_px"))) {
    config.pack.template_input_px = Get<int>(json, path, "/template/input_px");
    const int px = config.pack.template_input_px;
    if (px != 0 && px != config.pack.size_px) throw FormatError(path, "/template/input_px", "must be 0 or the crop's size_px");
  }
  config.pack.shape = config.shape;
  config.pack.fit_shape = false;
  config.pack.cameras = config.split.train_cameras;
  config.pack.frames = config.split.train_frames;
  const Json::json_pointer iou("/template/iou");
  config.template_iou = json.contains(iou) && json.at(iou).is_number() ? json.at(iou).get<double>() : std::nan("");
  return config;
}

RunConfig OpenRun(const std::string& folder, const std::string& dataset) {
  namespace fs = std::filesystem;
  if (!fs::is_directory(folder)) throw IoError(folder, "no such folder; give the --out folder of `mvstudio avatar train`");
  const std::string config_path = folder + "/" + kRunConfigFile, checkpoint = folder + "/" + kCheckpointFile;
  if (!fs::exists(config_path)) throw IoError(config_path, "is missing: not the folder of a training run");
  if (!fs::exists(checkpoint))
    throw IoError(checkpoint,
                  "is missing: the run has not reached its first checkpoint; train it or `mvstudio avatar resume` it");
  RunConfig config = ReadRunConfig(config_path);
  if (!dataset.empty()) config.dataset = dataset;
  if (!fs::is_directory(config.dataset)) {
    throw IoError(config.dataset,
                  "the dataset that " + config_path + " was trained on is not there; pass its new place with --dataset");
  }
  return config;
}

}  // namespace mvstudio::avatar
