#include "stages/nets/pretrain_input.h"

#include <algorithm>
#include <filesystem>
#include <set>

#include "avatar/body/templates/read.h"
#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/hash/sha256.h"
#include "core/join.h"
#include "core/json_view.h"
#include "stages/nets/avatar_fit.h"
#include "stages/words.h"

namespace mvstudio::stages {
namespace {

namespace fs = std::filesystem;
using avatar::MotionClip;
using JsonView = BasicJsonView<nlohmann::json>;

std::vector<std::string> BvhFiles(const std::string& text) {
  std::vector<std::string> files;
  for (const std::string& path : SplitCommas(text)) {
    if (!fs::is_directory(path)) {
      files.push_back(path);
      continue;
    }
    const std::vector<std::string> found = FilesNamed(path, "", ".bvh");
    if (found.empty()) throw IoError(path, "option 'motion': the folder holds no .bvh file");
    files.insert(files.end(), found.begin(), found.end());
  }
  return files;
}

/// DATASET:FRAMES; a folder whose own name looks like that comes first.
std::pair<std::string, std::vector<int>> DatasetAndFrames(const std::string& text) {
  const size_t colon = text.rfind(':');
  if (colon == std::string::npos || fs::exists(text)) return {text, {}};
  std::string frames = text.substr(colon + 1);
  std::replace(frames.begin(), frames.end(), '+', ',');
  const std::vector<int> numbers = ParseRanges("option 'poses' " + text, frames);
  if (numbers.empty()) throw UsageError("option 'poses' " + text + ": no frames behind the colon");
  return {text.substr(0, colon), numbers};
}

void AddSource(const std::string& path, bool dataset, std::vector<MotionClip> clips, PretrainInput* input) {
  MotionSource source{path, dataset, {}, 0, 0, 0};
  std::set<int> frames;
  for (MotionClip& clip : clips) {
    HoldOutBlocks(&clip);
    frames.insert(clip.frames.begin(), clip.frames.end());
    ++source.clips, source.poses += static_cast<int>(clip.poses.size());
    source.held_out += static_cast<int>(clip.held_out.size());
    input->sources.clips.push_back(std::move(clip));
  }
  source.frames.assign(frames.begin(), frames.end());
  input->motions.push_back(std::move(source));
}

template <class Matrix>
void Update(const Matrix& matrix, Sha256* digest) {
  digest->Update(matrix.data(), static_cast<size_t>(matrix.size()) * sizeof(typename Matrix::Scalar));
}

std::vector<int> FramesFrom(const JsonView& ranges) {
  try {
    return ParseRanges("frames", ranges.Text());
  } catch (const UsageError& error) {
    throw FormatError(ranges.path(), ranges.where(), error.what());
  }
}

std::string CanonicalPath(const std::string& path, const std::string& folder) {
  const fs::path full = fs::path(path).is_absolute() ? fs::path(path) : fs::absolute(folder) / path;
  return fs::weakly_canonical(full).string();
}

}  // namespace

std::vector<std::string> PretrainInput::Paths() const {
  std::vector<std::string> paths;
  for (const MotionSource& motion : motions) paths.push_back(motion.path);
  for (const std::string& name : templates) {
    if (name != "mannequin") paths.push_back(name);
  }
  return paths;
}

PretrainInput ReadPretrainInput(const std::string& motion, const std::string& poses, const std::string& templates,
                                int num_joints) {
  PretrainInput input;
  input.sources.num_joints = num_joints;
  for (const std::string& path : BvhFiles(motion)) AddSource(path, false, {avatar::ClipOfBvh(path)}, &input);
  for (const std::string& text : SplitCommas(poses)) {
    const auto [root, frames] = DatasetAndFrames(text);
    AddSource(root, true, avatar::ClipsOfDataset(root, frames), &input);
  }
  if (input.motions.empty())
    throw UsageError("there are no poses to learn from: give option 'motion' (animation files) or option 'poses' (datasets)");
  for (const std::string& path : TemplatesOf(templates)) {
    input.templates.push_back(path.empty() ? "mannequin" : path);
    input.sources.templates.push_back(body::ReadTemplate(path));
  }
  return input;
}

nlohmann::ordered_json ToJson(const std::vector<MotionSource>& motions, const std::string& folder, bool relative) {
  auto list = nlohmann::ordered_json::array();
  for (const MotionSource& motion : motions) {
    const fs::path path = PathOnDisk(motion.path);
    const fs::path shown = relative ? path.lexically_relative(PathOnDisk(folder)) : path;
    list.push_back({{"path", shown.string()},
                    {"kind", motion.dataset ? "dataset" : "animation"},
                    {"frames", RangesText(motion.frames)},
                    {"clips", motion.clips},
                    {"poses", motion.poses},
                    {"held_out", motion.held_out}});
  }
  return list;
}

std::string DigestOf(const avatar::PretrainSources& sources) {
  Sha256 digest;
  for (const MotionClip& clip : sources.clips) {
    for (const dataset::Coco19Pose& pose : clip.poses) {
      Update(pose.x_in_world, &digest);
      digest.Update(pose.valid.data(), pose.valid.size());
    }
    const int64_t count = static_cast<int64_t>(clip.poses.size());
    digest.Update(&count, sizeof(count));
  }
  for (const body::BodyTemplate& body : sources.templates) {
    Update(body.vertices, &digest), Update(body.faces, &digest), Update(body.face_uv, &digest);
    Update(body.skin_weights, &digest), Update(body.coco19, &digest), Update(body.shapes.vertices, &digest);
  }
  return digest.HexDigest();
}

std::optional<Notice> SeenPoses(const std::string& run, const avatar::RunConfig& config) {
  const std::string path = run + "/" + kPretrainFile;
  if (!fs::exists(path)) return std::nullopt;
  const auto json = JsonFromText<nlohmann::json>(ReadFile(path), {16, false}, path);
  std::set<int> scored(config.split.holdout_frames.begin(), config.split.holdout_frames.end());
  scored.insert(config.split.validation_frames.begin(), config.split.validation_frames.end());
  std::set<int> seen;
  const JsonView sources = JsonView(path, json)["sources"];
  for (size_t i = 0; i < sources.ArraySize(); ++i) {
    if (sources[i]["kind"].Text() != "dataset") continue;
    if (CanonicalPath(sources[i]["path"].Text(), run) != CanonicalPath(config.dataset, run)) continue;
    for (const int frame : FramesFrom(sources[i]["frames"])) {
      if (scored.count(frame)) seen.insert(frame);
    }
  }
  if (seen.empty()) return std::nullopt;
  return Notice{
      "AVA-PRETRAINED-SEEN",
      "the network of option 'init-from' " + run +
          " was pretrained with poses of frames that are held out here: " + RangesText({seen.begin(), seen.end()}),
      "pretrain without them (option 'poses' DATASET:FRAMES), or their scores are not those of a motion that nobody saw"};
}

}  // namespace mvstudio::stages
