#include "avatar/io/pack/run_config.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>
#include <type_traits>

#include "avatar/maps/bone_lists.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/json_tree.h"

namespace mvstudio::avatar {
namespace {

using Json = nlohmann::json;  // the ordered kind looks at every key for each one that it reads
constexpr const char* kGirthNames[kNumGirthGroups] = {"trunk", "head", "arms", "legs"};

Json ParseFile(const std::string& path) {
  const std::string text = ReadFile(path);
  constexpr size_t kMaxBytes = 16 << 20;  // a depth bomb cannot fit a config that stays small
  if (text.size() > kMaxBytes) throw FormatError(path, "", "is larger than any configuration");
  Json json;
  const JsonProblem problem = ParseJsonTree(text, {16, false}, &json);
  if (problem.kind == JsonProblem::Kind::kDepth) throw FormatError(path, "", "not valid JSON (nested too deeply)");
  if (problem.kind != JsonProblem::Kind::kNone) {
    throw FormatError(path, "byte " + std::to_string(problem.byte), "not valid JSON; was the training interrupted?");
  }
  return json;
}

// The library turns any number into an int without a word.
int ToInt(const Json& value) {
  const bool fits = value.is_number_unsigned()
                        ? value.get<uint64_t>() <= std::numeric_limits<int>::max()
                        : value.is_number_integer() && value.get<int64_t>() >= std::numeric_limits<int>::min();
  if (!fits) throw std::out_of_range("must be a whole number");
  return static_cast<int>(value.get<int64_t>());
}

// Member `pointer` of the file as a T.
template <class T>
T Get(const Json& json, const std::string& path, const std::string& pointer) {
  const Json::json_pointer at(pointer);
  if (!json.contains(at)) throw FormatError(path, pointer, "is missing");
  try {
    const Json& value = json.at(at);
    if constexpr (std::is_same_v<T, int>) {
      return ToInt(value);
    } else if constexpr (std::is_same_v<T, std::vector<int>>) {
      if (!value.is_array()) throw std::invalid_argument("must be a list");
      std::vector<int> numbers(value.size());
      std::transform(value.begin(), value.end(), numbers.begin(), ToInt);
      return numbers;
    } else {
      return value.get<T>();
    }
  } catch (const std::exception& error) {
    throw FormatError(path, pointer, error.what());
  }
}

// Paths that are not absolute are seen from the file.
std::string FromFolderOf(const std::string& file, const std::string& path) {
  namespace fs = std::filesystem;
  if (path.empty() || fs::path(path).is_absolute()) return path;
  return (fs::absolute(file).parent_path() / path).lexically_normal().string();
}

double Girth(const Json& json, const std::string& path, const std::string& pointer) {
  const double girth = Get<double>(json, path, pointer);
  if (!(girth > 0)) throw FormatError(path, pointer, "must be positive");
  return girth;
}

}  // namespace

void WriteRunConfig(const RunConfig& config, const std::string& path) {
  using Ordered = nlohmann::ordered_json;
  Ordered girth;
  for (int g = 0; g < kNumGirthGroups; ++g) girth[kGirthNames[g]] = config.shape.girth[g];
  const Ordered json = {{"schema", kRunConfigSchema},
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
                          {"iou", std::isfinite(config.template_iou) ? Ordered(config.template_iou) : Ordered()},
                          {"iuv", config.pack.iuv},
                          {"body", config.body_file}}}};
  WriteFileAtomic(path, json.dump(1) + "\n");
}

RunConfig ReadRunConfig(const std::string& path) {
  const Json json = ParseFile(path);
  if (!json.is_object() || Get<std::string>(json, path, "/schema") != kRunConfigSchema) {
    throw FormatError(path, "/schema", std::string("is not ") + kRunConfigSchema);
  }
  RunConfig config;
  config.dataset = FromFolderOf(path, Get<std::string>(json, path, "/dataset"));
  config.pack.size_px = Get<int>(json, path, "/crop/size_px");
  if (config.pack.size_px < 16 || config.pack.size_px > 4096) throw FormatError(path, "/crop/size_px", "must be 16 to 4096");
  config.pack.fill = Get<double>(json, path, "/crop/fill");
  if (!(config.pack.fill > 0)) throw FormatError(path, "/crop/fill", "must be positive");
  config.pack.person = Get<int>(json, path, "/crop/person");
  config.half_extent_m = Get<double>(json, path, "/crop/half_extent_m");
  if (json.contains(Json::json_pointer("/crop/joints"))) {
    config.pack.num_joints = Get<int>(json, path, "/crop/joints");
    config.pack.pose3d = FromFolderOf(path, Get<std::string>(json, path, "/crop/pose3d"));
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
    config.shape.girth[g] = Girth(json, path, std::string("/template/girth/") + kGirthNames[g]);
  if (json.contains(Json::json_pointer("/template/iuv")))
    config.pack.iuv = FromFolderOf(path, Get<std::string>(json, path, "/template/iuv"));
  if (json.contains(Json::json_pointer("/template/input_px"))) {
    config.pack.template_input_px = Get<int>(json, path, "/template/input_px");
    const int px = config.pack.template_input_px;
    if (px != 0 && px != config.pack.size_px) throw FormatError(path, "/template/input_px", "must be 0 or the crop's size_px");
  }
  if (json.contains(Json::json_pointer("/template/body"))) config.body_file = Get<std::string>(json, path, "/template/body");
  if (!config.body_file.empty()) {
    if (config.body_file != kPersonFile) throw FormatError(path, "/template/body", std::string("must be ") + kPersonFile);
    config.pack.fitted =
        std::make_shared<TexturedPerson>(ReadPerson((std::filesystem::path(path).parent_path() / kPersonFile).string()));
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
  if (!fs::is_directory(folder))
    throw IoError(folder, "no such folder; give the option 'out' folder of `mvstudio avatar train`");
  const std::string config_path = folder + "/" + kRunConfigFile, checkpoint = folder + "/" + kCheckpointFile;
  if (!fs::exists(config_path)) throw IoError(config_path, "is missing: not the folder of a training run");
  if (!fs::exists(checkpoint))
    throw IoError(checkpoint,
                  "is missing: the run has not reached its first checkpoint; train it or `mvstudio avatar resume` it");
  RunConfig config = ReadRunConfig(config_path);
  if (!dataset.empty()) config.dataset = dataset;
  if (!fs::is_directory(config.dataset)) {
    throw IoError(config.dataset,
                  "the dataset that " + config_path + " was trained on is not there; pass its new place with option 'dataset'");
  }
  return config;
}

}  // namespace mvstudio::avatar
