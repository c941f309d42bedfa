#include "avatar/run/pack/run_config.h"

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "avatar/maps/bone_lists.h"
#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/json_view.h"

namespace mvstudio::avatar {
namespace {

using Json = nlohmann::json;  // the ordered kind looks at every key for each one that it reads
using JsonView = BasicJsonView<Json>;
constexpr ChoiceWords<PoseBy, 2> kPoseBy = {{{PoseBy::kJoints, "joints"}, {PoseBy::kImages, "images"}}};
constexpr const char* kGirthNames[kNumGirthGroups] = {"trunk", "head", "arms", "legs"};

Json ParseFile(const std::string& path) {
  const std::string text = ReadFile(path);
  constexpr size_t kMaxBytes = 16 << 20;  // a depth bomb cannot fit a config that stays small
  if (text.size() > kMaxBytes) throw FormatError(path, "", "is larger than any configuration");
  return JsonFromText<Json>(text, {16, false}, path);
}

std::vector<int> Ints(const JsonView& list) {
  std::vector<int> numbers(list.ArraySize());
  for (size_t i = 0; i < numbers.size(); ++i) numbers[i] = list[i].PlainInt();
  return numbers;
}

std::vector<std::string> Texts(const JsonView& list) {
  std::vector<std::string> texts(list.ArraySize());
  for (size_t i = 0; i < texts.size(); ++i) texts[i] = list[i].Text();
  return texts;
}

// Paths that are not absolute are seen from the file.
std::string FromFolderOf(const std::string& file, const std::string& path) {
  namespace fs = std::filesystem;
  if (path.empty() || fs::path(path).is_absolute()) return path;
  return PathOnDisk((fs::path(file).parent_path() / path).string());
}

double Positive(const JsonView& json) {
  const double number = json.Number();
  if (!(number > 0)) json.Fail("must be positive");
  return number;
}

void ReadSplit(const JsonView& file, DatasetSplit* split) {
  const auto at = [&](const std::string& name) { return file.AtPointer("/split/" + name); };
  split->train_cameras = Texts(at("train_cameras"));
  split->train_frames = Ints(at("train_frames"));
  split->holdout_cameras = Texts(at("holdout_cameras"));
  split->holdout_frames = Ints(at("holdout_frames"));
  if (file.HasPointer("/split/validation_cameras")) {
    split->validation_cameras = Texts(at("validation_cameras"));
    split->validation_frames = Ints(at("validation_frames"));
  }
  if (split->train_cameras.empty()) at("train_cameras").Fail("is empty");
  if (split->train_frames.empty()) at("train_frames").Fail("is empty");
}

}  // namespace

std::string_view ToString(PoseBy pose_by) { return WordOf(kPoseBy, pose_by); }
void FromString(const std::string& text, PoseBy* pose_by) {
  *pose_by = KnownChoice(kPoseBy, text, "option 'pose-by' must be joints or images");
}

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
                          {"body", config.body_file},
                          {"pose_by", ToString(config.pack.pose_by)}}}};
  WriteFileAtomic(path, json.dump(1) + "\n");
}

RunConfig ReadRunConfig(const std::string& path) {
  const Json json = ParseFile(path);
  const JsonView file(path, json);
  const auto at = [&](const std::string& pointer) { return file.AtPointer(pointer); };
  if (at("/schema").Text() != kRunConfigSchema) at("/schema").Fail(std::string("is not ") + kRunConfigSchema);
  RunConfig config;
  config.dataset = FromFolderOf(path, at("/dataset").Text());
  config.pack.size_px = at("/crop/size_px").PlainInt();
  if (config.pack.size_px < 16 || config.pack.size_px > 4096) at("/crop/size_px").Fail("must be 16 to 4096");
  config.pack.fill = Positive(at("/crop/fill"));
  config.pack.person = at("/crop/person").PlainInt();
  config.half_extent_m = Positive(at("/crop/half_extent_m"));
  if (file.HasPointer("/crop/joints")) {
    config.pack.num_joints = at("/crop/joints").PlainInt();
    config.pack.pose3d = FromFolderOf(path, at("/crop/pose3d").Text());
    if (!IsJointList(config.pack.num_joints)) at("/crop/joints").Fail("must be 19, 25, 131 or 137");
  }
  config.pack.half_extent_m = config.half_extent_m;
  ReadSplit(file, &config.split);
  for (int g = 0; g < kNumGirthGroups; ++g)
    config.shape.girth[g] = Positive(at(std::string("/template/girth/") + kGirthNames[g]));
  if (file.HasPointer("/template/iuv")) config.pack.iuv = FromFolderOf(path, at("/template/iuv").Text());
  if (file.HasPointer("/template/input_px")) {
    config.pack.template_input_px = at("/template/input_px").PlainInt();
    const int px = config.pack.template_input_px;
    if (px != 0 && px != config.pack.size_px) at("/template/input_px").Fail("must be 0 or the crop's size_px");
  }
  if (file.HasPointer("/template/body")) config.body_file = at("/template/body").Text();
  if (file.HasPointer("/template/pose_by")) FromString(at("/template/pose_by").Text(), &config.pack.pose_by);
  if (!config.body_file.empty()) {
    if (config.body_file != body::kPersonFileName) at("/template/body").Fail(std::string("must be ") + body::kPersonFileName);
    const std::string body_path = (std::filesystem::path(path).parent_path() / body::kPersonFileName).string();
    config.pack.fitted = std::make_shared<const body::TexturedPerson>(body::ReadPerson(body_path));
  }
  config.pack.shape = config.shape;
  config.pack.fit_shape = false;
  config.pack.cameras = config.split.train_cameras;
  config.pack.frames = config.split.train_frames;
  const bool scored = file.HasPointer("/template/iou") && at("/template/iou").value().is_number();
  config.template_iou = scored ? at("/template/iou").Number() : std::nan("");
  return config;
}

bool HoldsGaussians(const std::string& folder) { return std::filesystem::exists(folder + "/" + kGaussiansFile); }

void RequireCheckpoint(const std::string& path) {
  if (std::filesystem::exists(path)) return;
  RequireFolder(std::filesystem::path(path).parent_path().string(),
                "; give the option 'out' folder of `mvstudio avatar train`");
  throw IoError(path,
                "is missing: the training has not reached its first checkpoint; where it no longer runs, begin it again with "
                "the same `mvstudio avatar train`");
}

RunConfig OpenRun(const std::string& folder, const std::string& dataset) {
  namespace fs = std::filesystem;
  RequireFolder(folder, "; give the option 'out' folder of `mvstudio avatar train`");
  const std::string config_path = folder + "/" + kRunConfigFile, checkpoint = folder + "/" + kCheckpointFile;
  if (!fs::exists(config_path)) throw IoError(config_path, "is missing: not the folder of a training run");
  if (!HoldsGaussians(folder)) RequireCheckpoint(checkpoint);
  RunConfig config = ReadRunConfig(config_path);
  config.pack.keep_views = HoldsGaussians(folder) || fs::exists(folder + "/" + kReferencesFile);
  if (config.pack.keep_views && !config.pack.fitted)
    throw FormatError(config_path, "/template/body", "is missing: Gaussians and references lie on a fitted body");
  if (!dataset.empty()) config.dataset = dataset;
  if (!fs::is_directory(config.dataset)) {
    throw IoError(config.dataset,
                  "the dataset that " + config_path + " was trained on is not there; pass its new place with option 'dataset'");
  }
  return config;
}

}  // namespace mvstudio::avatar
